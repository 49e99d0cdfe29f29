"""`replay.py RUN --verify`: computes a recorded run again and says whether it is the same to the last bit."""

from __future__ import annotations

import argparse
import json
from contextlib import closing
from dataclasses import asdict
from time import monotonic
from typing import Any

from fbql_common.core.errors import BadInput
from fbql_fusion.core.session import Session
from fbql_recording import Run
from fbql_recording.run_directory import git_revision, software_versions

from fbql.cli.interrupts import Interrupts
from fbql.cli.observations import know_observations
from fbql.cli.panel import print_result
from fbql.cli.places import ROOT
from fbql.cli.progress_line import ProgressLine
from fbql.replay.recomputation import Team, changed, recorded_parameters, recorded_policy, recorded_trees
from fbql.replay.verification import Difference, Verification, verify

IDENTICAL, DIFFERS = 0, 1


def verify_run(run: Run, arguments: argparse.Namespace, interrupts: Interrupts) -> int:
    """Verifies a run and prints what came of it. Gives 0 or 1. Raises BadInput, Interrupted."""
    parameters, notes = recorded_parameters(run)
    team = Team(run, recorded_trees(run), know_observations(arguments.observation))
    session = Session(parameters, recorded_policy(run))
    total = max(run.counts.values(), default=0)
    begun_s = monotonic()
    with closing(ProgressLine()) as line:

        def progress(steps: int) -> None:
            interrupts.check()
            line.show(f"verified {steps} of {total} steps, {steps / (monotonic() - begun_s):.0f} steps/s")

        found = verify(run, session, team, progress)
    if found.steps == 0 and found.difference is None:
        raise BadInput(f"{run.path}: no step in it; there is nothing to verify")
    seconds = monotonic() - begun_s
    difference = found.difference or _other_digest(run, found)
    if difference is not None:
        notes += changed(run, git_revision(ROOT), software_versions())
    if arguments.json:
        print_result(json.dumps(_values(run, found, difference, notes, seconds)))
    else:
        print_result(_words(found, difference, team, notes, seconds))
    return IDENTICAL if difference is None else DIFFERS


def _other_digest(run: Run, found: Verification) -> Difference | None:
    """The digest of the run's summary, where it is another one: a world state was changed that nobody acted on."""
    summary = run.summary
    if not run.is_complete or summary is None or summary.get("digest") == found.digest:
        return None
    return Difference(found.steps, -1, -1, run.end_ns or 0, "digest", summary.get("digest"), found.digest)


def _values(
    run: Run, found: Verification, difference: Difference | None, notes: list[str], seconds: float
) -> dict[str, Any]:
    return {
        "identical": difference is None,
        "steps": found.steps,
        "first_difference": None if difference is None else {**asdict(difference), "words": difference.words},
        "digest": found.digest,
        "not_recomputed": found.not_recomputed,
        "unfinished_steps": found.unfinished,
        "gap": found.gap,
        "complete": run.is_complete,
        "notes": [*notes, *run.warnings],
        "seconds": round(seconds, 3),
        "steps_per_s": round(found.steps / seconds, 1),
    }


def _words(found: Verification, difference: Difference | None, team: Team, notes: list[str], seconds: float) -> str:
    lines = [f"identical over {found.steps} steps ({found.steps / seconds:.0f} steps/s)"]
    if difference is not None:
        lines = [f"differs: {difference.words}", f"identical over the {found.steps} steps before"]
    lines += [
        f"as recorded, not computed again: {count} answers of {name}: {team.missing[name]}"
        for name, count in found.not_recomputed.items()
    ]
    if found.gap is not None:
        lines.append(f"not compared: from {found.gap} on; before it something is lost")
    if found.unfinished:
        lines.append("the step before the cut is not recorded whole, and is not compared")
    return "\n".join([*lines, *notes])
