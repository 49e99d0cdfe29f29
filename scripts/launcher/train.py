"""Plays a match without ROS, in one loop of the same core objects: the same options, results and digest as bringup."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from dataclasses import asdict
from time import monotonic

from fbql_common.core.errors import BadInput
from fbql_common.core.types import Phase
from fbql_fusion.core.session import Session
from fbql_fusion.run_directory import RunDirectory, git_revision, software_versions

from launcher.in_process import own_observation, parts_of, play, rehearse
from launcher.interrupts import Interrupts
from launcher.options import ROOT, Match, make_run_directory, match_from, match_parser, policy_told
from launcher.panel import Panel, print_result
from launcher.result import summary_text

PROGRAM = "train.py"
_DONE, _BAD_INPUT, _INCOMPLETE = 0, 2, 3


def main(argv: Sequence[str]) -> int:
    """Runs the command. Gives the exit code."""
    interrupts = Interrupts()
    parser = match_parser(PROGRAM, "Plays a match in one process without ROS, as fast as it goes. Nothing is recorded.")
    arguments = parser.parse_args(list(argv))
    try:
        match = match_from(arguments, PROGRAM)
        rehearse(match)
        session, loop, behaviors = parts_of(match)
        match = make_run_directory(match)
        run = RunDirectory(match.out, _config(match), list(match.behaviors.values()), _report)
    except BadInput as error:
        print(error, file=sys.stderr)
        return _BAD_INPUT
    panel = Panel()
    for note in match.notes:
        panel.say(note)
    begun_s = monotonic()

    def episode_ended() -> bool:
        run.add_episode(session.records[-1])
        panel.show(_status(session, monotonic() - begun_s))
        return not interrupts.came

    play(session, loop, behaviors, episode_ended)
    wall_s = monotonic() - begun_s
    panel.close()
    policy = session.policy()
    if policy is not None:
        run.write_policy(policy)
    summary = session.summary(wall_s, messages_recorded=0, incomplete=run.failed)
    run.write_summary(summary)
    run.close()
    values = summary._asdict()
    told = summary_text(values, match.out, match.simulation.dt_s, policy_told(match))
    print_result(json.dumps(values) if match.json else told)
    return _INCOMPLETE if run.failed else _DONE


def _config(match: Match) -> dict[str, object]:
    return {
        "versions": software_versions(),
        "git_revision": git_revision(ROOT),
        "parameters": {
            "simulator": asdict(match.simulation),
            "fusion": {**asdict(match.fusion), "policy": str(match.policy or "")},
            **{
                name: {"tree_file": str(path), **own_observation(match, name)} for name, path in match.behaviors.items()
            },
        },
    }


def _status(session: Session, elapsed_s: float) -> dict[str, str]:
    record = session.records[-1]
    outcomes = [each.outcome for each in session.records if each.phase is not Phase.GUIDED]
    return {
        "episode": str(record.index),
        "phase": record.phase.name.lower(),
        "step": str(record.steps),
        "goals": str(outcomes.count("goal")),
        "own_goals": str(outcomes.count("own_goal")),
        "timeouts": str(outcomes.count("timeout")),
        "steps_per_s": f"{session.steps / elapsed_s:.0f}",
        "weights": "",
    }


def _report(text: str) -> None:
    print(text, file=sys.stderr)
