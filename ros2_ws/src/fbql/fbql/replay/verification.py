"""Whether a recorded run can be computed again bit by bit: every leaf, reference, Q, weight and command.

What is compared are the bytes that would go over the wire. Where they differ the fields are looked at, so that padding,
which a middleware may leave as it was in memory, is no difference.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from struct import pack
from typing import Any, NamedTuple

from fbql_behaviors.core.behavior import Behavior
from fbql_common.core.cdr import Malformed
from fbql_common.core.errors import BadInput
from fbql_common.core.types import BehaviorOutput, World
from fbql_fusion.core.session import Session
from fbql_recording import Corrupt, Run
from fbql_recording.core.decoding import MessageCodec
from fbql_recording.core.steps import StepData

from fbql.replay.recomputation import OutOfPlace, Retold, Team

_SAY_STEPS = 4096


@dataclass(frozen=True)
class Difference:
    """The first thing that is not as it was recorded."""

    index: int
    """The step's number in the recording, from 0."""
    episode: int
    step: int
    stamp_ns: int
    what: str
    """The message and its field, in words: "weights of the decision"."""
    recorded: Any
    recomputed: Any

    @property
    def words(self) -> str:
        """In one line."""
        return (
            f"episode {self.episode}, step {self.step} (at {self.stamp_ns / 1e9:.3f} s): {self.what}: "
            f"recorded {self.recorded}, computed again {self.recomputed}"
        )


class Verification(NamedTuple):
    """What came of it."""

    steps: int
    """Steps that are identical, from the first on."""
    difference: Difference | None
    digest: str
    """Of the steps that were computed again."""
    not_recomputed: dict[str, int]
    """Answers of behaviors that were taken as recorded, because they can't be computed again."""
    unfinished: int
    """Steps at the end of a recording that was cut off of which messages are missing: not compared."""
    gap: str | None
    """The step behind the first gap of a recovered recording, in words. It, and all behind it, can't be compared."""


def verify(run: Run, session: Session, team: Team, progress: Callable[[int], None]) -> Verification:
    """Computes a recording again, up to the first difference.

    Args:
        run: the recording.
        session: made of the recorded parameters and policy.
        team: the behaviors with the recorded trees.
        progress: told how many steps are done, now and then.

    Raises:
        BadInput: the recording is damaged, or can't be computed again.
    """
    return _Verifier(run, session, team).run(progress)


class _Verifier:
    def __init__(self, run: Run, session: Session, team: Team) -> None:
        self._run = run
        self._retold = Retold(session)
        self._team = team
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
        for data in self._run.step_data():
            if data.after_gap:
                gap = f"episode {data.episode}, step {data.step} (at {data.stamp_ns / 1e9:.3f} s)"
                break
            if unfinished is not None:
                difference = self._missing(unfinished)
                break
            if not (data.data[0] and data.data[-1] and data.data[-2]):
                unfinished = data
                continue
            difference = self._step(data)
            if difference is not None:
                break
            self._index += 1
            if self._index % _SAY_STEPS == 0:
                progress(self._index)
        if difference is None and unfinished is not None and self._run.is_complete:
            difference = self._missing(unfinished)
        digest = self._retold.session.digest
        left_over = int(unfinished is not None and difference is None)
        return Verification(self._index, difference, digest, dict(self._not_recomputed), left_over, gap)

    def _step(self, data: StepData) -> Difference | None:
        parts = data.data
        try:
            world: World = self._world.decode(parts[0])
            try:
                self._retold.enter(data.episode, data.step, data.begins_again)
            except OutOfPlace as error:
                return self._difference(data, "the schedule", f"episode {data.episode}", str(error))
            outputs: list[BehaviorOutput | None] = []
            for place, recorded in enumerate(parts[1:-2]):
                if not recorded:
                    outputs.append(None)
                    continue
                output = self._answer(place, world, recorded)
                if isinstance(output, _Differs):
                    return self._differs(data, f"the answer of {self._run.behaviors[place]}", output)
                outputs.append(output)
            command, decision = self._retold.session.decide(world, outputs)
        except Malformed as error:
            raise Corrupt(f"{self._run.path}: episode {data.episode}, step {data.step}: {error}") from None
        # The command follows from the weights: it is looked at last.
        for what, codec, value, recorded in (
            ("the decision", self._decision, decision, parts[-1]),
            ("the command", self._command, command, parts[-2]),
        ):
            differs = _compared(codec, value, recorded)
            if differs is not None:
                return self._differs(data, what, differs)
        self._retold.left(world.ended)
        return None

    def _answer(self, place: int, world: World, recorded: bytes) -> BehaviorOutput | _Differs:
        """The answer computed again; as recorded where it can't be."""
        codec = self._output
        assert codec is not None
        behavior = self._behaviors[place]
        if behavior is not None:
            output = behavior.answer(world)
            if codec.is_ours and codec.encode(output) == recorded:
                return output
        as_recorded: BehaviorOutput = codec.decode(recorded)
        name = self._run.behaviors[place]
        if behavior is None or as_recorded.tree_hash != behavior.tree.hash:
            self._behaviors[place] = behavior = self._team.behavior(name, as_recorded.tree_hash)
        if behavior is None:
            self._not_recomputed[name] += 1
            return as_recorded
        output = behavior.answer(world)
        return _compared(codec, output, recorded) or output

    def _missing(self, data: StepData) -> Difference:
        parts = {"world state": 0, "command": -2, "decision": -1}
        lacking = [name for name, place in parts.items() if not data.data[place]]
        return self._difference(data, "messages", f"no {' and no '.join(lacking)}", "all of them")

    def _differs(self, data: StepData, of: str, differs: _Differs) -> Difference:
        what = f"{differs.field} of {of}"
        return self._difference(data, what, differs.recorded, differs.recomputed)

    def _difference(self, data: StepData, what: str, recorded: Any, recomputed: Any) -> Difference:
        return Difference(self._index, data.episode, data.step, data.stamp_ns, what, recorded, recomputed)


class _Differs(NamedTuple):
    """A field that differs."""

    field: str
    recorded: Any
    recomputed: Any


def _codec(run: Run, name: str) -> MessageCodec[Any]:
    codec = run.codec(f"fbql_msgs/msg/{name}")
    if codec is None:
        raise BadInput(f"{run.path}: no {name} messages in it; it can't be computed again")
    return codec


def _compared(codec: MessageCodec[Any], value: Any, recorded: bytes) -> _Differs | None:
    """The first field, in the order in which one follows from the other, whose bits are not as recorded."""
    if codec.is_ours and codec.encode(value) == recorded:
        return None
    there = codec.decode(recorded)
    names = sorted(set(value._fields) - codec.missing, key=lambda name: _FIRST.get(name, len(_FIRST)))
    for name in names:
        was, is_now = getattr(there, name), getattr(value, name)
        if _bits(was) != _bits(is_now):
            return _Differs(name, was, is_now)
    return None


_FIRST: Mapping[str, int] = {
    name: rank
    for rank, name in enumerate(
        (
            "observation",
            "leaf_id",
            "left_rad_s",
            "right_rad_s",
            "joint_state",
            "reward",
            "q",
            "learned_weights",
            "weights",
            "driver",
        )
    )
}


def _bits(value: Any) -> Any:
    """What two values that are the same to the last bit have in common: -0.0 is not 0.0, and NaN is NaN."""
    if isinstance(value, float):
        return pack("<d", value)
    if isinstance(value, tuple):
        return tuple(map(_bits, value))  # pyright: ignore[reportUnknownArgumentType, reportUnknownVariableType]
    return value
