"""The rules of twist_mux 4, stated a second time: for each message everything is computed anew from the whole history.

1. A priority counts as the nearest number from 0 to 255.
2. A source or lock with a timeout has expired when its last message is older than the timeout, or when none has come;
   with a timeout of 0 or less it never expires.
3. A lock is on if it has expired, or its last message said true.
4. A source is masked if it has expired, or if some lock that is on has a higher priority than it.
5. Of the sources that are not masked, and whose priority is not 0, one of the highest priority drives: the first by name.
6. A message is passed on exactly if its source drives at the moment when it comes.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from fbql_common.core.twist import Twist
from fbql_fusion.core.mux.config import Lock, MuxConfig, Source


class Event(NamedTuple):
    """A message: a source's command (`on` is None), or a lock's."""

    time_ns: int
    """When it is read, and passed on or not."""
    name: str
    on: bool | None = None
    received_ns: int | None = None
    """When it came, if earlier: its age counts from then."""

    @property
    def came_ns(self) -> int:
        """When it came."""
        return self.time_ns if self.received_ns is None else self.received_ns


def passed_on(sources: Sequence[Source], locks: Sequence[Lock], events: Sequence[Event]) -> list[int]:
    """Places of those events that are commands and are passed on. Times never go back."""
    return [
        place
        for place, event in enumerate(events)
        if event.on is None and driver(sources, locks, events[: place + 1], event.time_ns) == event.name
    ]


def driver(sources: Iterable[Source], locks: Iterable[Lock], events: Sequence[Event], now_ns: int) -> str | None:
    """The source that drives after these events."""
    on = [lock for lock in locks if has_expired(lock, of_locks(events), now_ns) or last_said(lock, events)]
    candidates = [
        source
        for source in sources
        if not has_expired(source, of_sources(events), now_ns)
        and not any(limited(lock) > limited(source) for lock in on)
        and limited(source) != 0
    ]
    best = sorted(candidates, key=lambda source: (-limited(source), source.name.encode()))
    return best[0].name if best else None


def limited(entry: Source | Lock) -> int:
    """Rule 1."""
    return sorted((0, entry.priority, 255))[1]


def of_locks(events: Iterable[Event]) -> list[Event]:
    """The messages of locks."""
    return [event for event in events if event.on is not None]


def of_sources(events: Iterable[Event]) -> list[Event]:
    """The commands."""
    return [event for event in events if event.on is None]


def has_expired(entry: Source | Lock, events: Iterable[Event], now_ns: int) -> bool:
    """Rule 2."""
    if entry.timeout_s <= 0:
        return False
    fresh = [event for event in events if event.name == entry.name and now_ns - event.came_ns <= entry.timeout_s * 1e9]
    return not fresh


def last_said(lock: Lock, events: Iterable[Event]) -> bool:
    """What the last message of a lock said; false before there is one."""
    said = [event.on for event in of_locks(events) if event.name == lock.name]
    return bool(said and said[-1])


class Schedule(NamedTuple):
    """A mux and what it receives."""

    config: MuxConfig
    events: list[Event]


STEP_NS = 5_000_000
"""All times and timeouts are multiples of this, so that ages that equal a timeout are common."""
PRIORITIES = (-7, 0, 1, 10, 10, 20, 50, 100, 254, 255, 256, 1000)


def random_schedule(generator: np.random.Generator) -> Schedule:
    """One to six sources, up to three locks, and up to sixty messages with pauses in which things expire."""

    def entry(kind: type[Source] | type[Lock], name: str) -> Source | Lock:
        timeout_s = float(generator.choice([0.0, -1.0, *([1.0] * 6)])) * STEP_NS * 1e-9 * int(generator.integers(1, 12))
        return kind(name, f"of_{name}", timeout_s, int(generator.choice(PRIORITIES)))

    names = sorted(generator.choice([*"abcdefghij"], generator.integers(1, 7), replace=False).tolist())
    sources = tuple(entry(Source, name) for name in names)
    locks = tuple(entry(Lock, f"lock_{name}") for name in range(generator.integers(0, 4)))
    events: list[Event] = []
    now_ns = int(generator.integers(0, 10**6)) * STEP_NS
    talkative = generator.dirichlet(np.full(len(sources) + len(locks), 0.7))
    for _ in range(generator.integers(1, 61)):
        now_ns += STEP_NS * int(generator.choice([0, 0, 1, 1, 1, 2, 3, 5, 8, 13]))
        place = int(generator.choice(len(talkative), p=talkative))
        if place < len(sources):
            events.append(Event(now_ns, sources[place].name))
        else:
            events.append(Event(now_ns, locks[place - len(sources)].name, bool(generator.integers(2))))
    return Schedule(MuxConfig(sources, locks), events)


def read_late(events: Iterable[Event], generator: np.random.Generator) -> list[Event]:
    """The same messages where the mux is busy now and then: all that come meanwhile are read when it is done."""
    free_ns, found = 0, list[Event]()
    for event in events:
        if generator.random() < 0.15:
            free_ns = max(free_ns, event.time_ns + STEP_NS * int(generator.choice([1, 3, 8, 20])))
        found.append(event._replace(time_ns=max(event.time_ns, free_ns), received_ns=event.time_ns))
    return found


def numbered(place: int) -> Twist:
    """A command that tells which event it is."""
    return Twist(linear_x_m_s=float(place))
