"""The mux: who drives, by priorities, timeouts and locks.

These are the rules of ros-teleop/twist_mux 4 (docs/mux.md has them, with the few differences): a command is passed on when
it arrives, and only if its source is the winner at that moment. Nothing is kept to be passed on later, so no command is
ever older than its source's timeout.

There is no clock here: the caller passes the time of any clock [ns]. Age is measured from reception: `now_ns` is the time of a
decision, `received_ns` that of receiving what it is about, which is earlier where the caller was busy.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from fbql_common.core.twist import Twist

from fbql_fusion.core.mux.config import Lock, MuxConfig, Source, rank, timeout_ns
from fbql_fusion.core.mux.parameters import NEVER


class SourceState(NamedTuple):
    """A source at one moment."""

    source: Source
    command: Twist | None
    """Its last command; None before the first."""
    age_ns: int | None
    """Time since that command was received [ns]."""
    expired: bool
    locked: bool
    """Whether a lock of a higher priority is on."""

    @property
    def masked(self) -> bool:
        """Whether it may not drive, whatever the others do."""
        return self.expired or self.locked

    @property
    def can_drive(self) -> bool:
        """Whether it has a command that may be passed on."""
        return self.command is not None and not self.masked and rank(self.source) > 0


class LockState(NamedTuple):
    """A lock at one moment."""

    lock: Lock
    on: bool
    expired: bool
    """Whether it has been silent for too long, which also turns it on."""


class Snapshot(NamedTuple):
    """Everything that a decision at one moment may depend on."""

    now_ns: int
    sources: tuple[SourceState, ...]
    locks: tuple[LockState, ...]
    lock_priority: int
    """Sources below this are locked; 0 while no lock is on."""
    winner: int | None
    """The source whose next command will be passed on."""
    driver: int | None
    """The source whose command was passed on last, unless it is masked by now: then nobody drives."""


@dataclass(slots=True)
class _Entry:
    """What is known of a source or a lock."""

    rank: int
    timeout_ns: int | None
    heard_ns: int | None = None
    command: Twist | None = None
    on: bool = False

    def expired(self, now_ns: int) -> bool:
        """Whether it was silent for too long. A reception in the future, on a clock that was set back, does not count."""
        if self.timeout_ns is None:
            return False
        return self.heard_ns is None or not 0 <= now_ns - self.heard_ns <= self.timeout_ns


class Mux:
    """Passes on the commands of the source that wins."""

    def __init__(self, config: MuxConfig) -> None:
        self.config = config
        self._sources = [_Entry(rank(source), timeout_ns(source)) for source in config.sources]
        self._locks = [_Entry(rank(lock), timeout_ns(lock)) for lock in config.locks]
        drivers = [index for index, source in enumerate(self._sources) if source.rank > 0]
        self._order = sorted(drivers, key=lambda index: -self._sources[index].rank)
        """Those that may ever drive, the highest priority first; equals stay in order."""
        self._last: int | None = None
        """The source whose command was passed on last."""
        self._zero_ns: int | None = None
        """When the last zero command since then was due; None before the first."""

    def hear(self, index: int, command: Twist, now_ns: int, received_ns: int | None = None) -> bool:
        """Takes a command of source `index`, received at `received_ns`, or now. Returns whether to pass it on."""
        self.take(index, command, now_ns if received_ns is None else received_ns)
        if self.winner(now_ns) != index:
            return False
        self.passed_on(index)
        return True

    def take(self, index: int, command: Twist, received_ns: int) -> None:
        """Takes a command of source `index`, where somebody else decides whether it is passed on."""
        source = self._sources[index]
        source.heard_ns, source.command = received_ns, command

    def passed_on(self, index: int) -> None:
        """Notes that a command of source `index` is passed on."""
        self._last, self._zero_ns = index, None

    def last(self, index: int, now_ns: int) -> tuple[Twist | None, int]:
        """The last command of source `index` and its age [ns]; None before the first."""
        source = self._sources[index]
        return source.command, 0 if source.heard_ns is None else now_ns - source.heard_ns

    def may_drive(self, index: int, now_ns: int) -> bool:
        """Whether a source is not masked, and not of priority 0."""
        source = self._sources[index]
        return source.rank > 0 and not source.expired(now_ns) and source.rank >= self.lock_priority(now_ns)

    def hear_lock(self, index: int, on: bool, received_ns: int) -> None:
        """Takes a message of lock `index`."""
        lock = self._locks[index]
        lock.heard_ns, lock.on = received_ns, on

    def lock_priority(self, now_ns: int) -> int:
        """The highest priority of the locks that are on; 0 if none is."""
        return max((lock.rank for lock in self._locks if lock.on or lock.expired(now_ns)), default=0)

    def winner(self, now_ns: int) -> int | None:
        """The source whose command is passed on if one comes now: the highest priority above 0 that is not masked."""
        lock_priority = self.lock_priority(now_ns)
        for index in self._order:
            source = self._sources[index]
            if source.rank < lock_priority:
                return None
            if not source.expired(now_ns):
                return index
        return None

    def driver(self, now_ns: int) -> int | None:
        """The source whose command was passed on last, unless it is masked by now: then nobody drives."""
        if self._last is None:
            return None
        source = self._sources[self._last]
        return None if source.expired(now_ns) or source.rank < self.lock_priority(now_ns) else self._last

    def zero_due(self, now_ns: int) -> bool:
        """Whether a zero command is to be published now, because a lock stops the source that drove last.

        Call it at every message of a lock, and often enough besides to notice that one has expired; each True counts as
        published. Always False where the config says NEVER.
        """
        if self.config.zero_when_locked == NEVER or self._last is None:
            return False
        if self._sources[self._last].rank >= self.lock_priority(now_ns):
            return False
        if self._zero_ns is not None:
            period_ns = self.config.zero_period_ns
            if period_ns is None or 0 <= now_ns - self._zero_ns < period_ns:
                return False
        self._zero_ns = now_ns
        return True

    def snapshot(self, now_ns: int) -> Snapshot:
        """The state at this moment, for callers that decide at their own times."""
        lock_priority = self.lock_priority(now_ns)
        sources = tuple(
            SourceState(
                source,
                entry.command,
                None if entry.heard_ns is None else now_ns - entry.heard_ns,
                entry.expired(now_ns),
                entry.rank < lock_priority,
            )
            for source, entry in zip(self.config.sources, self._sources, strict=True)
        )
        locks = tuple(
            LockState(lock, entry.on or entry.expired(now_ns), entry.expired(now_ns))
            for lock, entry in zip(self.config.locks, self._locks, strict=True)
        )
        return Snapshot(now_ns, sources, locks, lock_priority, self.winner(now_ns), self.driver(now_ns))
