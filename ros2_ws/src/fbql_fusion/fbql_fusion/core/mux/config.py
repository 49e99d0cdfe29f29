"""Sources and locks of a mux."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from fbql_common.core.errors import BadInput

from fbql_fusion.core.mux.parameters import NEVER, REPEAT, LockParameters, MuxParameters, SourceParameters

HIGHEST = 255
"""The highest priority; configured ones are clamped to 0 to this."""
_NS = 1_000_000_000
_LONGEST_S = 1e12
"""Nothing is known for so long: a timeout above it counts as this [s]."""


@dataclass(frozen=True)
class Source:
    """A sender of velocity commands.

    Attributes:
        timeout_s: it may not drive after being silent for longer than this [s]; 0 or less: it never expires.
        priority: the highest drives; clamped to 0 to 255, and 0 never drives.
    """

    name: str
    topic: str
    timeout_s: float
    priority: int


@dataclass(frozen=True)
class Lock:
    """A switch that stops all sources below its priority.

    Attributes:
        timeout_s: it is on after being silent for longer than this [s]; 0 or less: it never expires.
        priority: clamped to 0 to 255.
    """

    name: str
    topic: str
    timeout_s: float
    priority: int


@dataclass(frozen=True)
class MuxConfig:
    """Sources and locks in order; among sources of equal priority the first drives.

    Attributes:
        zero_when_locked: NEVER, ONCE or REPEAT.
        zero_period_s: time between repeated zero commands [s].

    Raises:
        BadInput: no source, two with the same name, or two sources with the same topic.
    """

    sources: tuple[Source, ...]
    locks: tuple[Lock, ...] = ()
    zero_when_locked: str = NEVER
    zero_period_s: float = 0.1

    def __post_init__(self) -> None:
        if not self.sources:
            raise BadInput(
                "there is no source of commands; give each as topics.NAME.{topic,timeout,priority}, in a file under the "
                "node's name or /**"
            )
        topics: dict[str, str] = {}
        for source in self.sources:
            if (other := topics.setdefault(source.topic, source.name)) != source.name:
                raise BadInput(f"topics.{other} and topics.{source.name} are both {source.topic}; remove one of them")
        for kind, entries in (("topics", self.sources), ("locks", self.locks)):
            for entry in entries:
                if not entry.topic:
                    raise BadInput(f"{kind}.{entry.name}.topic is empty")

    @property
    def zero_period_ns(self) -> int | None:
        """Time between repeated zero commands [ns]; None if there is at most one."""
        return _ns(self.zero_period_s) if self.zero_when_locked == REPEAT else None


def rank(entry: Source | Lock) -> int:
    """Its priority, clamped."""
    return min(max(entry.priority, 0), HIGHEST)


def timeout_ns(entry: Source | Lock) -> int | None:
    """Its timeout [ns]; None if it never expires."""
    return _ns(entry.timeout_s) if _ns(entry.timeout_s) > 0 else None


def _ns(duration_s: float) -> int:
    return int(min(max(duration_s, -_LONGEST_S), _LONGEST_S) * _NS)


def mux_config(
    settings: MuxParameters, topics: Mapping[str, SourceParameters], locks: Mapping[str, LockParameters]
) -> MuxConfig:
    """The mux that parameters describe, with sources and locks in their order. Raises BadInput."""
    return MuxConfig(
        tuple(Source(name, each.topic, each.timeout, each.priority) for name, each in topics.items()),
        tuple(Lock(name, each.topic, each.timeout, each.priority) for name, each in locks.items()),
        settings.zero_when_locked,
        settings.zero_period_s,
    )
