"""How a recomputed run is compared with the recorded one: by the fields of messages, bit by bit."""

from __future__ import annotations

from dataclasses import dataclass
from struct import pack
from typing import Any, NamedTuple

from fbql_recording.core.decoding import MessageCodec


@dataclass(frozen=True)
class Difference:
    """The first difference from what was recorded."""

    index: int
    """Index of the step in the recording, from 0."""
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
            f"recorded {self.recorded}, recomputed {self.recomputed}"
        )


class Verification(NamedTuple):
    """The result of recomputing a run."""

    steps: int
    """Identical steps, of those that were recomputed as a whole."""
    difference: Difference | None
    digest: str | None
    """Of the recomputed steps; None without a session."""
    not_recomputed: dict[str, int]
    """By behavior: answers that were taken as recorded, because they can't be recomputed."""
    unfinished: int
    """Steps with missing messages before a gap, or at the end of a recording that was cut off; not compared."""
    gap: str | None
    """The step after the first gap of a recovered recording, in words."""
    answers_only: int = 0
    """Steps of which only the behaviors' answers were recomputed, and are identical: after a gap, or without a session."""
    resumed: str | None = None
    """The step after the first gap from which on everything was recomputed again, in words."""
    draws_as_recorded: int = 0
    """Random draws of a driver after a gap that were taken as recorded: the number of lost draws is unknown."""
    answers: int = 0
    """Answers that were recomputed."""


class Differs(NamedTuple):
    """A field whose bits differ."""

    field: str
    recorded: Any
    recomputed: Any


def compared(codec: MessageCodec[Any], value: Any, recorded: bytes) -> Differs | None:
    """The first field, in causal order, whose bits differ from the recorded ones."""
    if codec.is_ours and codec.encode(value) == recorded:
        return None
    there = codec.decode(recorded)
    names = sorted(
        set(value._fields) - codec.missing, key=lambda name: _CAUSES.index(name) if name in _CAUSES else len(_CAUSES)
    )
    for name in names:
        was, is_now = getattr(there, name), getattr(value, name)
        if _bits(was) != _bits(is_now):
            return Differs(name, was, is_now)
    return None


_CAUSES = (
    *("observation", "leaf_id", "left_rad_s", "right_rad_s"),
    *("joint_state", "reward", "q", "learned_weights", "weights", "driver"),
)
"""Fields in causal order: each may depend on those before it; the others come last."""


def _bits(value: Any) -> Any:
    """A value to compare bit by bit: -0.0 is not 0.0, and NaN equals NaN."""
    if isinstance(value, float):
        return pack("<d", value)
    if isinstance(value, tuple):
        return tuple(map(_bits, value))  # pyright: ignore[reportUnknownArgumentType, reportUnknownVariableType]
    return value
