"""The messages of a recording, joined to steps by stamp, episode and step, in whatever order they were recorded."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from struct import Struct
from typing import NamedTuple

from fbql_common.core.types import BehaviorOutput, Decision, WheelCommand, World

_WINDOW = 16
"""Newer steps that have begun, after which a step is no longer waited for."""
_ASSEMBLED = 256
"""Steps that are assembled at the same time at most, whatever their order."""
_REMEMBERED = 256
"""Steps that are remembered as already returned."""
_KEY = Struct("<iI4x6s6xqq")
"""The beginning of every message of ours: sec, nanosec, the frame's length, the frame, episode, step."""
_FRAME = b"field\0"

Key = tuple[int, int, int]
"""stamp_ns, episode, step"""


class Step(NamedTuple):
    """One step: a world state, the behaviors' answers to it, and fusion's command and decision. None: not recorded."""

    stamp_ns: int
    episode: int
    step: int
    world: World | None
    outputs: tuple[BehaviorOutput | None, ...]
    """In the order of the run's `behaviors`."""
    command: WheelCommand | None
    decision: Decision | None
    begins_again: bool = False
    """Whether fusion restarted the episode with this step, because the world was lost."""
    after_gap: bool = False
    """Whether damage may have removed steps between the previous one and this one."""


class StepData:
    """A step as the recorded bytes; b"" where nothing was recorded."""

    __slots__ = ("after_gap", "begins_again", "data", "episode", "missing", "stamp_ns", "step")

    def __init__(self, key: Key, messages: int) -> None:
        self.stamp_ns, self.episode, self.step = key
        self.data = [b""] * messages
        """World state, answers in the order of the behaviors, command, decision."""
        self.missing = messages
        self.begins_again = False
        """Whether fusion restarted the episode with this step, because the world was lost."""
        self.after_gap = False
        """Whether damage may have removed steps between the previous one and this one."""


def key_of(data: bytes) -> Key | None:
    """The key of a message of ours, without decoding the rest; None if it has another frame, or is not such a
    message."""
    if len(data) < 4 + _KEY.size or data[:2] != b"\x00\x01":
        return None
    sec, nanosec, frame, episode, step = _KEY.unpack_from(data, 4)
    return (sec * 1_000_000_000 + nanosec, episode, step) if frame == _FRAME else None


class StepJoin:
    """Joins messages to steps.

    Steps come out in the order in which their first messages came; each as soon as it is complete and all before it
    have been returned, or when _WINDOW newer ones have begun after it. Older steps that come late do not count as newer;
    no more than _ASSEMBLED are kept all the same. A second message of the same kind for a step is left out.

    Args:
        messages: how many a complete step has.
    """

    def __init__(self, messages: int) -> None:
        self.repeated = 0
        """Messages that were left out: a step's command that was sent again, a world state that was requested again."""
        self._messages = messages
        self._pending: dict[Key, StepData] = {}
        self._done: deque[Key] = deque(maxlen=_REMEMBERED)
        self._done_set: set[Key] = set()
        self._begins_again = self._after_gap = False

    def add(self, place: int, key: Key, data: bytes) -> None:
        """Adds a message; `place` is its index in `StepData.data`."""
        step = self._pending.get(key)
        if step is None:
            if key in self._done_set:
                self.repeated += 1
                return
            step = self._pending[key] = StepData(key, self._messages)
            step.begins_again, step.after_gap = self._begins_again, self._after_gap
            self._begins_again = self._after_gap = False
        if step.data[place]:
            self.repeated += 1
            return
        step.data[place] = data
        step.missing -= 1

    def mark_next(self, *, begins_again: bool, after_gap: bool) -> None:
        """Marks that the next step restarts its episode, or follows a gap. All steps before it must have been returned
        (`rest`)."""
        self._begins_again |= begins_again
        self._after_gap |= after_gap
        if begins_again:
            self._done.clear()
            self._done_set.clear()

    def ready(self) -> Iterator[StepData]:
        """The steps that are ready."""
        while self._pending:
            key = next(iter(self._pending))
            step = self._pending[key]
            if step.missing and (len(self._pending) <= _WINDOW or not self._is_overdue(key)):
                return
            yield self._out(key)

    def _is_overdue(self, oldest: Key) -> bool:
        """Whether to stop waiting for the step that arrived first. All other pending steps have begun after it."""
        return len(self._pending) > _ASSEMBLED or sum(key > oldest for key in self._pending) >= _WINDOW

    def rest(self) -> Iterator[StepData]:
        """All others, at the end."""
        for key in list(self._pending):
            yield self._out(key)

    def _out(self, key: Key) -> StepData:
        if len(self._done) == _REMEMBERED:
            self._done_set.discard(self._done[0])
        self._done.append(key)
        self._done_set.add(key)
        return self._pending.pop(key)
