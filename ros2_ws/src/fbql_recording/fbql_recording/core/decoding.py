"""Recorded bytes to domain types, by the schema that was recorded with them.

The schema, not this release, determines what the bytes hold: a recording of another version can be read as long as it
has the fields that we need, in any order and among any others.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, get_type_hints

from fbql_common.core.cdr import Codec, Malformed
from fbql_common.core.errors import BadInput
from fbql_common.core.mux_types import MuxDecision
from fbql_common.core.types import FIELD_FRAME, BehaviorOutput, Decision, WheelCommand, World

from fbql_recording.core.ros2msg import MessageField, fields_of

NS = 1_000_000_000
TYPES: dict[str, type[Any]] = {
    "fbql_msgs/msg/WorldState": World,
    "fbql_msgs/msg/BehaviorOutput": BehaviorOutput,
    "fbql_msgs/msg/WheelCommand": WheelCommand,
    "fbql_msgs/msg/FusionDecision": Decision,
}
"""The domain type of each message type of a step of soccer."""
MUX_DECISION = "fbql_msgs/msg/MuxDecision"
_KINDS: dict[str, type[Any]] = {**TYPES, MUX_DECISION: MuxDecision}
_FRAMES = {MUX_DECISION: ""}
"""The frame of messages that are not in the field's."""

_HEADER = ("header.stamp.sec", "header.stamp.nanosec", "header.frame_id")
_INTEGERS = frozenset(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64))
_FITTING: dict[Any, frozenset[str]] = {
    bool: frozenset({"bool"}),
    int: _INTEGERS,
    float: frozenset({"float32", "float64"}),
    str: frozenset({"string"}),
}


class MessageCodec[T]:
    """Turns recorded bytes of one message type into a domain type, and the domain type into bytes again.

    Args:
        type_name: pkg/msg/Name, one of `TYPES`, or MUX_DECISION.
        schema: the ros2msg text of the recording.

    Raises:
        BadInput: the schema lacks a field that is needed, or has it with another type.
    """

    def __init__(self, type_name: str, schema: str) -> None:
        self.kind: type[T] = _KINDS[type_name]
        self._frame = _FRAMES.get(type_name, FIELD_FRAME)
        fields = fields_of(type_name, schema)
        try:
            self._codec = Codec([field.kind for field in fields])
        except TypeError as error:
            raise BadInput(f"the schema recorded for {type_name}: {error}") from None
        places = _places(self.kind, fields, type_name)
        self.is_ours = places == list(range(len(fields)))
        """Whether the recorded message has our fields, in our order, and no others: only then can it be encoded."""
        kind: Any = self.kind
        names: Sequence[str] = kind._fields
        self.missing = frozenset(name for name, place in zip(names[1:], places[3:], strict=True) if place is None)
        """Fields that the recorded message lacks because it is older than they are: they get their defaults."""
        self._pick = None if self.is_ours else [place for place in places if place is not None]
        self._defaults = [kind._field_defaults[name] for name in names if name in self.missing]
        self._make: Callable[[Sequence[Any]], T] = kind._make

    def decode(self, data: bytes) -> T:
        """The domain type.

        Raises:
            Malformed: not such a message, a stamp that is not a valid time, or another frame than its kind's.
        """
        values: list[Any] = self._codec.decode(data)
        if self._pick is not None:
            values = [values[place] for place in self._pick] + self._defaults
        sec, nanosec, frame = values[:3]
        if sec < 0 or nanosec >= NS:
            raise Malformed(f"the stamp ({sec} s, {nanosec} ns) is not a valid time")
        if frame != self._frame:
            raise Malformed(f"frame_id is '{frame}', expected '{self._frame}'")
        values[:3] = (sec * NS + nanosec,)
        return self._make(values)

    def encode(self, value: T) -> bytes:
        """The bytes of a domain type, as our nodes publish them. Raises TypeError where not `is_ours`."""
        if not self.is_ours:
            raise TypeError("the recorded message has other fields than ours")
        values: Any = value
        return self._codec.encode((values[0] // NS, values[0] % NS, self._frame, *values[1:]))


def _places(kind: type[Any], fields: Sequence[MessageField], type_name: str) -> list[int | None]:
    """The position of each field of a domain type in the recorded message, the header's three first.

    Fields with a default, which come last, may be missing: None.
    """
    there = {field.name: index for index, field in enumerate(fields)}
    hints = get_type_hints(kind)
    wanted: list[tuple[str, Any]] = list(zip(_HEADER, (int, int, str), strict=True))
    wanted += [(name, hints[name]) for name in kind._fields[1:]]
    places: list[int | None] = []
    for name, hint in wanted:
        if name not in there and name in kind._field_defaults:
            places.append(None)
            continue
        if name not in there:
            raise BadInput(f"the schema recorded for {type_name} lacks the field {name}, which is needed")
        recorded = fields[there[name]].kind
        if not _fits(recorded, hint):
            raise BadInput(f"the schema recorded for {type_name} has {name} as {recorded}, which is not usable")
        places.append(there[name])
    return places


def _fits(recorded: str, hint: Any) -> bool:
    if hint in _FITTING:
        return recorded in _FITTING[hint]
    element = recorded.removeprefix("sequence<").removesuffix(">")
    return element != recorded and element in _FITTING[hint.__args__[0]]
