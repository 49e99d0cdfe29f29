"""`replay RUN --verify`: recomputes a recorded run, every leaf, reference, Q, weight and command, and compares bit by bit.

The bytes that would go over the wire are compared. If they differ, the fields are compared: a middleware may leave
garbage in the padding, which does not count as a difference.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Callable, Mapping
from contextlib import closing
from dataclasses import asdict
from time import monotonic
from typing import Any

from fbql_behaviors.core.behavior import Behavior
from fbql_common.core.cdr import Malformed
from fbql_common.core.errors import BadInput
from fbql_common.core.text import as_lines
from fbql_common.core.types import BehaviorOutput, World
from fbql_fusion.controller_loading import resolve_controller
from fbql_fusion.core.controllers.interface import Drawing
from fbql_fusion.core.soccer_session import SoccerSession
from fbql_recording.core.decoding import MessageCodec
from fbql_recording.core.steps import StepData
from fbql_recording.mcap.reader import Corrupt
from fbql_recording.run import Run
from fbql_recording.run_directory import own_revision, software_versions

from fbql.cli.exit_codes import DONE, FAILED
from fbql.cli.interrupts import Interrupts
from fbql.cli.observations import register_observations, unused_observations
from fbql.cli.output import LiveLine, complain, json_text, print_result
from fbql.replay.differences import Difference, Differs, Verification, compared
from fbql.replay.mux_verification import verify_mux
from fbql.replay.recomputation import (
    OutOfPlace,
    RecordedBehaviors,
    RecordedSession,
    changed_software,
    recorded_parameters,
    recorded_playing_trees,
    recorded_policy,
    recorded_trees,
    what_is_lost,
)

_PROGRESS_STEPS = 4096


def verify(
    run: Run, session: SoccerSession | None, behaviors: RecordedBehaviors, progress: Callable[[int], None]
) -> Verification:
    """Recomputes a recording up to the first difference.

    Args:
        run: the recording.
        session: made of the recorded parameters and policy; None where they are lost: then only the behaviors' answers,
            which depend on the world state and the tree alone, are recomputed.
        behaviors: with the recorded trees.
        progress: called now and then with the number of steps done.

    Raises:
        BadInput: the recording is damaged, or can't be recomputed.
    """
    return _Verifier(run, session, behaviors).run(progress)


class _Verifier:
    def __init__(self, run: Run, session: SoccerSession | None, behaviors: RecordedBehaviors) -> None:
        self._run = run
        self._session = session
        self._recorded = None if session is None else RecordedSession(session)
        self._drawing: Drawing | None = None
        """The controller, from when its draws are taken as recorded."""
        self._answers_made = 0
        self._made = behaviors
        self._world = _codec(run, "WorldState")
        self._output = run.codec("fbql_msgs/msg/BehaviorOutput")
        self._command = _codec(run, "WheelCommand")
        self._decision = _codec(run, "FusionDecision")
        self._behaviors: list[Behavior | None] = [None] * len(run.behaviors)
        self._not_recomputed: Counter[str] = Counter()
        self._index = 0

    def run(self, progress: Callable[[int], None]) -> Verification:
        difference: Difference | None = None
        unfinished: StepData | None = None
        gap: str | None = None
        resumed: str | None = None
        follows = self._recorded is not None
        """Whether the session is where the recording is."""
        answers_only = left_over = 0
        for data in self._run.step_data():
            if data.after_gap:
                gap = gap or _words_of(data)
                left_over += unfinished is not None
                follows, unfinished = False, None
            elif unfinished is not None:
                difference = self._missing(unfinished)
                break
            if not (data.data[0] and data.data[-1] and data.data[-2]):
                # What follows a gap may be the rest of a step.
                unfinished = None if data.after_gap else data
                continue
            if not follows and self._resume(data):
                follows, resumed = True, resumed or _words_of(data)
            difference = self._step(data) if follows else self._answers(data)
            if difference is not None:
                break
            self._index += 1
            answers_only += not follows
            if self._index % _PROGRESS_STEPS == 0:
                progress(self._index)
        if difference is None and unfinished is not None and self._run.is_complete:
            difference = self._missing(unfinished)
        return Verification(
            self._index - answers_only,
            difference,
            None if self._session is None else self._session.digest,
            dict(self._not_recomputed),
            left_over + (unfinished is not None and difference is None),
            gap,
            answers_only,
            resumed,
            0 if self._drawing is None else self._drawing.draws_taken,
            self._answers_made,
        )

    def _resume(self, data: StepData) -> bool:
        """Resumes with a step after a gap, if it begins an episode whose decisions depend on nothing before it. Returns
        whether it did."""
        if self._session is None or self._recorded is None or not self._session.forgets_episodes or data.step != 0:
            return False
        try:
            # An episode that began again is degraded from its first step on.
            if self._decision.decode(data.data[-1]).degraded:
                return False
        except Malformed as error:
            raise Corrupt(f"{self._run.path}: episode {data.episode}, step {data.step}: {error}") from None
        self._recorded.resume(data.episode)
        self._drawing = self._session.drawing
        return True

    def _answers(self, data: StepData) -> Difference | None:
        """Recomputes the behaviors' answers, which depend on the world state alone."""
        try:
            world: World = self._world.decode(data.data[0])
            for place, recorded in enumerate(data.data[1:-2]):
                output = self._answer(place, world, recorded) if recorded else None
                if isinstance(output, Differs):
                    return self._differs(data, f"the answer of {self._run.behaviors[place]}", output)
        except Malformed as error:
            raise Corrupt(f"{self._run.path}: episode {data.episode}, step {data.step}: {error}") from None
        return None

    def _step(self, data: StepData) -> Difference | None:
        assert self._recorded is not None
        parts = data.data
        try:
            world: World = self._world.decode(parts[0])
            try:
                self._recorded.enter(data.episode, data.step, data.begins_again)
            except OutOfPlace as error:
                return self._difference(data, "the schedule", f"episode {data.episode}", str(error))
            outputs: list[BehaviorOutput | None] = []
            for place, recorded in enumerate(parts[1:-2]):
                if not recorded:
                    outputs.append(None)
                    continue
                output = self._answer(place, world, recorded)
                if isinstance(output, Differs):
                    return self._differs(data, f"the answer of {self._run.behaviors[place]}", output)
                outputs.append(output)
            if self._drawing is not None:
                self._drawing.known_draw = self._decision.decode(parts[-1]).driver
            command, decision = self._recorded.session.decide(world, outputs)
            # The command follows from the weights: it is compared last.
            for what, codec, value, recorded in (
                ("the decision", self._decision, decision, parts[-1]),
                ("the command", self._command, command, parts[-2]),
            ):
                differs = compared(codec, value, recorded)
                if differs is not None:
                    return self._differs(data, what, differs)
        except Malformed as error:
            raise Corrupt(f"{self._run.path}: episode {data.episode}, step {data.step}: {error}") from None
        self._recorded.left(world.ended)
        return None

    def _answer(self, place: int, world: World, recorded: bytes) -> BehaviorOutput | Differs:
        """The recomputed answer; the recorded one where it can't be recomputed."""
        codec = self._output
        assert codec is not None
        behavior = self._behaviors[place]
        if behavior is not None:
            output = behavior.answer(world)
            if codec.is_ours and codec.encode(output) == recorded:
                self._answers_made += 1
                return output
        as_recorded: BehaviorOutput = codec.decode(recorded)
        name = self._run.behaviors[place]
        if behavior is None or as_recorded.tree_hash != behavior.tree.hash:
            self._behaviors[place] = behavior = self._made.behavior(name, as_recorded.tree_hash)
        if behavior is None:
            self._not_recomputed[name] += 1
            return as_recorded
        self._answers_made += 1
        output = behavior.answer(world)
        return compared(codec, output, recorded) or output

    def _missing(self, data: StepData) -> Difference:
        parts = {"world state": 0, "command": -2, "decision": -1}
        lacking = [name for name, place in parts.items() if not data.data[place]]
        return self._difference(data, "messages", f"no {' and no '.join(lacking)}", "all of them")

    def _differs(self, data: StepData, of: str, differs: Differs) -> Difference:
        what = f"{differs.field} of {of}"
        return self._difference(data, what, differs.recorded, differs.recomputed)

    def _difference(self, data: StepData, what: str, recorded: Any, recomputed: Any) -> Difference:
        return Difference(self._index, data.episode, data.step, data.stamp_ns, what, recorded, recomputed)


def _words_of(data: StepData) -> str:
    return f"episode {data.episode}, step {data.step} (at {data.stamp_ns / 1e9:.3f} s)"


def _codec(run: Run, name: str) -> MessageCodec[Any]:
    codec = run.codec(f"fbql_msgs/msg/{name}")
    if codec is None:
        raise BadInput(f"{run.path}: no {name} messages in it; it can't be recomputed")
    return codec


def verify_run(run: Run, arguments: argparse.Namespace, interrupts: Interrupts) -> int:
    """Verifies a run and prints the result. Returns 0 if it is identical, else 1. Raises BadInput, Interrupted."""
    if run.is_of_mux:
        return _report(run, arguments, interrupts, lambda progress: verify_mux(run, progress), {}, "", [])
    controller = resolve_controller(arguments.controller).name if arguments.controller else ""
    trees, sources = recorded_trees(run), register_observations(arguments.observation)
    for note in unused_observations(sources, {tree.behavior for tree in trees.values()}):
        complain(note)
    behaviors = RecordedBehaviors(run, trees, sources)
    lost, notes, session = what_is_lost(run), [], None
    if not lost:
        parameters, notes = recorded_parameters(run)
        if controller not in ("", parameters.controller):
            raise BadInput(f"--controller {arguments.controller}: the run's controller is '{parameters.controller}'")
        session = SoccerSession(parameters, recorded_policy(run), recorded_playing_trees(run))
    recompute = lambda progress: verify(run, session, behaviors, progress)  # noqa: E731
    return _report(run, arguments, interrupts, recompute, behaviors.missing, lost, notes)


def _report(
    run: Run,
    arguments: argparse.Namespace,
    interrupts: Interrupts,
    recompute: Callable[[Callable[[int], None]], Verification],
    missing: Mapping[str, str],
    lost: str,
    notes: list[str],
) -> int:
    """Recomputes a run and prints the result.

    Args:
        recompute: does it; is given what to call now and then with the number of steps done.
        missing: why answers of a behavior can't be recomputed, by its name; filled meanwhile.
        lost: what is lost of the inputs of the decisions, in words.
        notes: how this release's parameters differ.
    """
    total = max(run.counts.values(), default=0)
    begun_s = monotonic()
    with closing(LiveLine()) as line:

        def progress(steps: int) -> None:
            interrupts.check()
            line.show(f"verified {steps} of {total} steps, {steps / (monotonic() - begun_s):.0f} steps/s")

        found = recompute(progress)
    if found.steps + found.answers_only == 0 and found.difference is None:
        raise BadInput(f"{run.path}: no step in it; there is nothing to verify")
    if lost and not found.answers:
        raise BadInput(f"{run.path}: {lost}, and no answer can be recomputed either; there is nothing to verify")
    seconds = monotonic() - begun_s
    difference = found.difference or _other_digest(run, found)
    if difference is not None:
        notes += changed_software(run, own_revision(), software_versions())
    if arguments.json:
        values = _values(run, found, difference, notes, seconds)
        print_result(json_text({**values, "decisions_not_recomputed": lost or None}))
    else:
        print_result(_words(found, difference, missing, lost, notes, seconds))
    return DONE if difference is None else FAILED


def _other_digest(run: Run, found: Verification) -> Difference | None:
    """The digest in the run's summary, if it differs: then a world state that nothing depended on was changed."""
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
        "answers_only": found.answers_only,
        "resumed": found.resumed,
        "draws_as_recorded": found.draws_as_recorded,
        "complete": run.is_complete,
        "notes": [*notes, *run.warnings],
        "seconds": round(seconds, 3),
        "steps_per_s": round(found.steps / seconds, 1),
    }


def _words(
    found: Verification,
    difference: Difference | None,
    missing: Mapping[str, str],
    lost: str,
    notes: list[str],
    seconds: float,
) -> str:
    lines = [f"identical over {found.steps} steps ({found.steps / seconds:.0f} steps/s)"]
    if not found.steps:
        lines = [
            f"no step could be compared as a whole; the behaviors' answers are identical in {found.answers_only} steps"
        ]
    if difference is not None:
        lines = [f"differs: {difference.words}", f"identical over the {found.steps} steps before"]
    lines += [
        f"as recorded, not recomputed: {count} answers of {name}: {missing[name]}"
        for name, count in found.not_recomputed.items()
    ]
    if found.gap is not None:
        lines.append(f"messages before {found.gap} are lost")
        if found.resumed is not None:
            lines.append(f"everything is compared again from {found.resumed} on, where an episode begins")
        if found.answers_only and not lost:
            lines.append(
                f"of {found.answers_only} steps after a gap only the behaviors' answers were compared, and are identical: "
                "the decisions depend on what is lost"
            )
    if found.draws_as_recorded:
        lines.append(
            f"taken as recorded: {found.draws_as_recorded} random draws of a driver after the gap; how many draws are lost "
            "is not known"
        )
    if lost:
        lines.append(f"decisions and commands were not compared: {lost}")
    if found.unfinished:
        lines.append("the last step before the cut or a gap is incomplete and was not compared")
    return as_lines([*lines, *notes])
