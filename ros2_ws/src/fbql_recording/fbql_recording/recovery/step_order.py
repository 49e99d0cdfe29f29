"""Whether the recorded steps follow each other: a world state comes after the one before it, in time and by number.

Fusion marks an episode as degraded where a step never arrived; such a hole was recorded as it was. Any other is a sign
that messages are missing, or that a part of the file belongs to another recording.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from fbql_common.core.cdr import Malformed
from fbql_common.core.errors import BadInput
from fbql_common.core.types import Decision, World

from fbql_recording.core.decoding import MessageCodec
from fbql_recording.core.steps import Key, key_of
from fbql_recording.mcap.reader import Topic

_WORLD, _DECISION = "fbql_msgs/msg/WorldState", "fbql_msgs/msg/FusionDecision"


@dataclass
class StepRange:
    """The steps of a part of a recording."""

    first: Key
    last: Key
    is_degraded: bool = True
    """Whether fusion knew, when it decided the first step, that steps before it never arrived; or that is not known."""
    has_ended: bool = True
    """Whether the last step ended its episode; or that is not known."""
    breaks: list[str] = field(default_factory=list[str])
    """Where steps inside do not follow each other, in words."""


def break_between(before: StepRange, after: StepRange) -> str:
    """Why a part can't follow another one without a gap, in words; "" if it can."""
    return _break(before.last, before.has_ended, after.first, after.is_degraded)


def _break(before: Key, has_ended: bool, key: Key, is_degraded: bool) -> str:
    if key == before:
        return ""  # sent again
    (last_ns, last_episode, last_step), (stamp_ns, episode, step) = before, key
    is_next = (episode == last_episode and step <= last_step + 1) or (
        episode == last_episode + 1 and step == 0 and has_ended
    )
    # A step number that goes back while time goes on: the episode began again.
    if stamp_ns > last_ns and (is_next or is_degraded):
        return ""
    return f"episode {episode}, step {step} follows episode {last_episode}, step {last_step}"


class StepReader:
    """Reads the steps of one part after the other, as far as the recording has messages of ours."""

    def __init__(self) -> None:
        self._worlds: dict[int, MessageCodec[World]] = {}
        self._decisions: dict[int, MessageCodec[Decision]] = {}
        self._begin()

    def describe(self, channel: int, topic: Topic) -> None:
        """Adds a channel; of other types than ours, or with schemas that can't be used, nothing is read."""
        if channel in self.channels or topic.type_name not in (_WORLD, _DECISION) or topic.message_encoding != "cdr":
            return
        try:
            if topic.type_name == _WORLD and not self._worlds:
                self._worlds[channel] = MessageCodec(_WORLD, topic.schema)
            elif topic.type_name == _DECISION and not self._decisions:
                self._decisions[channel] = MessageCodec(_DECISION, topic.schema)
        except BadInput:
            return

    @property
    def channels(self) -> set[int]:
        """Those whose messages `add` wants."""
        return {*self._worlds, *self._decisions}

    def add(self, channel: int, data: bytes) -> None:
        """Reads a message."""
        key = key_of(data)
        if key is None:
            return
        if channel in self._decisions:
            if key in self._open and not self._is_degraded(channel, data):
                words = self._open[key]
                if words:
                    self._breaks.append(words)
                elif key == self._first:
                    self._starts_degraded = False
            self._open.pop(key, None)
            return
        if self._first is None or self._last is None:
            self._first = key
            self._open[key] = ""
        else:
            before = self._last
            has_ended = key[1] == before[1] or self._has_ended(channel)
            if words := _break(before, has_ended, key, is_degraded=False):
                if key[0] <= before[0]:
                    self._breaks.append(words)
                else:
                    self._open[key] = words
        self._last, self._last_data, self._last_channel = key, data, channel

    def take(self) -> StepRange | None:
        """The steps since the last call; None without any."""
        if self._first is None or self._last is None:
            return None
        found = StepRange(
            self._first, self._last, self._starts_degraded, self._has_ended(self._last_channel), self._breaks
        )
        self._begin()
        return found

    def _begin(self) -> None:
        self._first: Key | None = None
        self._last: Key | None = None
        self._last_data = b""
        self._last_channel = 0
        self._starts_degraded = True
        self._open: dict[Key, str] = {}
        """Steps whose decision is still to come -> the break before it; "" for the first step."""
        self._breaks: list[str] = []

    def _has_ended(self, channel: int) -> bool:
        try:
            return self._worlds[channel].decode(self._last_data).ended
        except Malformed:
            return True

    def _is_degraded(self, channel: int, data: bytes) -> bool:
        try:
            return self._decisions[channel].decode(data).degraded
        except Malformed:
            return True
