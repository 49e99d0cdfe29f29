"""The mux passes on exactly what twist_mux's rules pass on, and never an old command."""

from __future__ import annotations

import itertools

import mux_oracle
import numpy as np
import pytest
from fbql_common.core.errors import BadInput
from fbql_common.core.twist import Twist
from fbql_fusion.core.mux.config import Lock, MuxConfig, Source, mux_config
from fbql_fusion.core.mux.mux import Mux, Snapshot
from fbql_fusion.core.mux.parameters import ONCE, REPEAT, LockParameters, MuxParameters, SourceParameters
from mux_oracle import Event, Schedule, numbered, passed_on, random_schedule, read_late

MS = 1_000_000
GO = Twist(0.5)
SEED = 14


def play(mux: Mux, events: list[Event]) -> list[int]:
    """Places of the commands that the mux passes on."""
    sources = [source.name for source in mux.config.sources]
    locks = [lock.name for lock in mux.config.locks]
    passed: list[int] = []
    for place, event in enumerate(events):
        if event.on is not None:
            mux.hear_lock(locks.index(event.name), event.on, event.came_ns)
        elif mux.hear(sources.index(event.name), numbered(place), event.time_ns, event.received_ns):
            passed.append(place)
    return passed


def agree(seeds: range, busy: bool = False) -> tuple[int, int]:
    """Compares mux and oracle over schedules, of a mux that is `busy` now and then. Returns how many commands were passed on, and how
    many were not."""
    passed = held = 0
    for seed in seeds:
        generator = np.random.default_rng((SEED, seed))
        schedule = random_schedule(generator)
        if busy:
            schedule = schedule._replace(events=read_late(schedule.events, generator))
        expected = passed_on(schedule.config.sources, schedule.config.locks, schedule.events)
        assert play(Mux(schedule.config), schedule.events) == expected, f"schedule {seed}: {schedule}"
        passed += len(expected)
        held += len(mux_oracle.of_sources(schedule.events)) - len(expected)
    return passed, held


def test_output_of_random_schedules_is_that_of_the_rules() -> None:
    passed, held = agree(range(400))
    assert min(passed, held) > 1000, "both outcomes are common"


def test_ages_count_from_reception_where_the_mux_was_busy() -> None:
    passed, held = agree(range(400), busy=True)
    assert min(passed, held) > 1000


@pytest.mark.long
@pytest.mark.timeout(3600)
def test_output_of_ten_thousand_random_schedules_is_that_of_the_rules() -> None:
    agree(range(10_000))
    agree(range(10_000), busy=True)


def mux_of(*sources: tuple[str, float, int], locks: tuple[tuple[str, float, int], ...] = (), **options: object) -> Mux:
    """A mux of (name, timeout, priority)."""
    return Mux(
        MuxConfig(
            tuple(Source(name, name, timeout_s, priority) for name, timeout_s, priority in sources),
            tuple(Lock(name, name, timeout_s, priority) for name, timeout_s, priority in locks),
            **options,  # pyright: ignore[reportArgumentType]
        )
    )


def test_a_command_is_passed_on_only_at_its_own_arrival() -> None:
    mux = mux_of(("high", 0.5, 20), ("low", 0.5, 10))
    assert mux.hear(1, GO, 0)
    assert mux.hear(0, GO, 1)
    assert not mux.hear(1, GO, 100 * MS)
    assert mux.winner(501 * MS) == 1, "the high one has expired ..."
    assert mux.hear(1, GO, 501 * MS), "... and the low one drives with its next command, not with one that was kept"


@pytest.mark.parametrize(("age_ns", "expired"), [(500 * MS, False), (500 * MS + 1, True)])
def test_a_source_expires_when_it_is_older_than_its_timeout_not_at_it(age_ns: int, expired: bool) -> None:
    mux = mux_of(("high", 0.5, 20), ("low", 0.5, 10))
    mux.hear(0, GO, 0)
    assert mux.hear(1, GO, age_ns) is expired


def test_a_source_with_a_timeout_is_expired_before_its_first_message_and_one_without_blocks_from_the_start() -> None:
    assert mux_of(("high", 0.5, 20), ("low", 0.5, 10)).hear(1, GO, 0)
    assert not mux_of(("high", 0.0, 20), ("low", 0.5, 10)).hear(1, GO, 0)


@pytest.mark.parametrize(("timeout_s", "drives"), [(1e308, True), (-1e308, False)])
def test_a_timeout_may_be_of_any_size(timeout_s: float, drives: bool) -> None:
    mux = mux_of(("high", timeout_s, 20), ("low", 0.5, 10), locks=(("stop", timeout_s, 5),))
    assert mux.hear(1, GO, 0) is drives, "above 0 it has expired before its first message, else it never expires"
    mux.hear(0, GO, 1)
    assert not mux.hear(1, GO, 10**18)


@pytest.mark.parametrize(("priority", "may_drive"), [(9, False), (10, True), (11, True)])
def test_a_lock_masks_the_sources_below_its_priority_and_not_those_at_it(priority: int, may_drive: bool) -> None:
    mux = mux_of(("source", 0.5, priority), locks=(("stop", 0.0, 10),))
    mux.hear(0, GO, 0)
    mux.hear_lock(0, True, 1)
    assert mux.may_drive(0, 2) is may_drive


def test_a_lock_with_a_timeout_is_on_before_its_first_message_and_one_without_is_off() -> None:
    assert not mux_of(("low", 0.5, 10), locks=(("stop", 0.5, 20),)).hear(0, GO, 0)
    assert mux_of(("low", 0.5, 10), locks=(("stop", 0.0, 20),)).hear(0, GO, 0)


@pytest.mark.parametrize(("priority", "drives"), [(9, False), (10, True), (11, True)])
def test_a_lock_stops_what_is_below_its_priority_and_lets_its_equal_drive(priority: int, drives: bool) -> None:
    mux = mux_of(("a", 0.5, priority), locks=(("stop", 0.0, 10), ("weaker", 0.0, 5)))
    mux.hear_lock(0, True, 0)
    mux.hear_lock(1, True, 0)
    assert mux.hear(0, GO, 0) is drives
    mux.hear_lock(0, False, 1)
    assert mux.hear(0, GO, 1)


@pytest.mark.parametrize(("high", "low"), [(255, 254), (1000, 255), (1, 0), (10, -1)])
def test_a_priority_counts_within_0_and_255(high: int, low: int) -> None:
    mux = mux_of(("first", 0.5, low), ("second", 0.5, high))
    first, second = mux.hear(0, GO, 0), mux.hear(1, GO, 0)
    if low >= 255:
        assert (first, second) == (True, False), "both count as 255, and the first drives"
    else:
        assert (first, second) == (low > 0, True)


def test_a_source_of_priority_0_never_drives() -> None:
    mux = mux_of(("idle", 0.0, 0))
    assert not mux.hear(0, GO, 0)
    assert not mux.snapshot(0).sources[0].can_drive


def test_a_message_from_the_future_is_no_sign_of_life() -> None:
    """A clock that was set back, as at the restart of a simulation."""
    mux = mux_of(("high", 0.5, 20), ("low", 0.5, 10), locks=(("stop", 0.5, 15),))
    mux.hear_lock(0, False, 900 * MS)
    mux.hear(0, GO, 900 * MS)
    assert mux.winner(800 * MS) is None, "the lock counts as silent"
    mux.hear_lock(0, False, 800 * MS)
    assert mux.hear(1, GO, 800 * MS)


def all_orders(events: int) -> list[tuple[int, ...]]:
    return list(itertools.permutations(range(events)))


@pytest.mark.parametrize("order", all_orders(3))
def test_among_equals_the_first_by_name_drives_in_any_order_of_arrival(order: tuple[int, ...]) -> None:
    mux = mux_of(("a", 0.5, 10), ("b", 0.5, 10), ("c", 0.5, 10))
    for index in order:
        mux.hear(index, GO, 0)
    assert [mux.hear(index, GO, 1) for index in range(3)] == [True, False, False]


# Snapshots


def test_a_snapshot_has_each_sources_command_and_age_and_why_it_may_not_drive() -> None:
    mux = mux_of(
        ("dead", 0.1, 30),
        ("locked", 0.5, 5),
        ("new", 0.5, 40),
        ("well", 0.5, 20),
        locks=(("stop", 0.0, 10), ("dog", 0.2, 1)),
    )
    mux.hear_lock(0, True, 0)
    for index in (0, 1, 3):
        mux.hear(index, numbered(index), 0)
    now = mux.snapshot(300 * MS)
    told = {
        state.source.name: (state.command, state.age_ns, state.expired, state.locked, state.can_drive)
        for state in now.sources
    }
    assert told == {
        "dead": (numbered(0), 300 * MS, True, False, False),
        "locked": (numbered(1), 300 * MS, False, True, False),
        "new": (None, None, True, False, False),
        "well": (numbered(3), 300 * MS, False, False, True),
    }
    assert [(state.on, state.expired) for state in now.locks] == [(True, False), (True, True)]
    assert (now.lock_priority, now.winner, now.driver) == (10, 3, 0 if now.sources[0].can_drive else None)


def test_nobody_drives_once_the_last_driver_is_masked() -> None:
    mux = mux_of(("a", 0.5, 10), locks=(("stop", 0.0, 20),))
    assert mux.driver(0) is None
    mux.hear(0, GO, 0)
    assert mux.driver(500 * MS) == 0
    assert mux.driver(501 * MS) is None
    mux.hear(0, GO, 502 * MS)
    mux.hear_lock(0, True, 503 * MS)
    assert mux.driver(503 * MS) is None


def test_a_lock_of_its_own_priority_leaves_the_last_driver() -> None:
    mux = mux_of(("a", 0.5, 10), locks=(("stop", 0.0, 10),))
    mux.hear(0, GO, 0)
    mux.hear_lock(0, True, 1)
    assert mux.driver(2) == 0


def can_be_taken(now: Snapshot) -> list[tuple[str, Twist, int]]:
    """Name, command and age of every source that somebody who decides on a snapshot may let drive."""
    found: list[tuple[str, Twist, int]] = []
    for state in now.sources:
        if state.can_drive:
            assert state.command is not None
            assert state.age_ns is not None
            found.append((state.source.name, state.command, state.age_ns))
    return found


def kill_one(seed: int) -> int:
    """Plays a schedule in which one source dies, and checks every command that is passed on or on offer at a fixed rate.

    Returns how many commands were seen of the source that died.
    """
    generator = np.random.default_rng((SEED, seed))
    config, events = random_schedule(generator)
    config = MuxConfig(tuple(Source(s.name, s.topic, abs(s.timeout_s) or 0.05, s.priority) for s in config.sources))
    events = [event for event in events if event.on is None]
    if not events:
        return 0
    victim = config.sources[int(generator.integers(len(config.sources)))]
    killed_ns = events[int(generator.integers(len(events)))].time_ns
    events = [event for event in events if event.name != victim.name or event.time_ns <= killed_ns]
    timeouts_ns = {source.name: source.timeout_s * 1e9 for source in config.sources}
    mux, names, seen, sent_ns = Mux(config), [source.name for source in config.sources], 0, dict[float, int]()
    begin_ns, end_ns = events[0].time_ns, killed_ns + int(timeouts_ns[victim.name]) + 20 * mux_oracle.STEP_NS
    for now_ns in range(begin_ns, end_ns, mux_oracle.STEP_NS // 2):
        while events and events[0].time_ns <= now_ns:
            event = events.pop(0)
            command = numbered(len(sent_ns))
            sent_ns[command.linear_x_m_s] = event.time_ns
            seen += mux.hear(names.index(event.name), command, event.time_ns) and event.name == victim.name
        for name, command, age_ns in can_be_taken(mux.snapshot(now_ns)):
            assert age_ns == now_ns - sent_ns[command.linear_x_m_s] <= timeouts_ns[name], f"schedule {seed}"
            assert name != victim.name or now_ns <= killed_ns + timeouts_ns[name], f"schedule {seed}"
            seen += name == victim.name
        driver = mux.driver(now_ns)
        assert driver is None or names[driver] != victim.name or now_ns <= killed_ns + timeouts_ns[victim.name]
    return seen


def test_no_command_of_a_source_that_died_is_older_than_its_timeout() -> None:
    """Issue 14: any source killed 1000 times."""
    assert sum(kill_one(seed) > 0 for seed in range(1000)) > 500, "most of those that die had driven, or could have"


# Zero when a lock stops the robot

LOCKED = (("stop", 0.0, 20), ("dog", 0.2, 15))


def stopping(how: str, **options: object) -> Mux:
    """A mux whose source 'low' has just driven, beside a silent 'high'."""
    mux = mux_of(("high", 0.5, 30), ("low", 0.5, 10), locks=LOCKED, zero_when_locked=how, **options)
    mux.hear_lock(1, False, 0)
    assert not mux.zero_due(0), "nobody has driven"
    assert mux.hear(1, GO, 0)
    assert not mux.zero_due(1), "nothing stops it"
    return mux


def test_no_zero_is_due_unless_requested() -> None:
    mux = stopping("never")
    mux.hear_lock(0, True, 2)
    assert not mux.zero_due(2)


def test_a_zero_is_due_once_for_each_time_that_a_lock_stops_a_driver() -> None:
    mux = stopping(ONCE)
    mux.hear_lock(0, True, 2)
    assert [mux.zero_due(now_ns) for now_ns in (2, 3, 900 * MS)] == [True, False, False]
    mux.hear_lock(0, False, 901 * MS)
    mux.hear_lock(1, False, 901 * MS)
    assert not mux.zero_due(901 * MS)
    assert mux.hear(1, GO, 902 * MS)
    mux.hear_lock(0, True, 903 * MS)
    assert mux.zero_due(903 * MS)


def test_zeros_are_due_at_their_period_until_the_lock_is_off() -> None:
    mux = stopping(REPEAT, zero_period_s=0.1)
    mux.hear_lock(0, True, 2)
    due = [now_ns for now_ns in range(2, 301 * MS, 25 * MS) if mux.zero_due(now_ns)]
    assert due == [2, 100 * MS + 2, 200 * MS + 2, 300 * MS + 2]
    mux.hear_lock(0, False, 302 * MS)
    mux.hear_lock(1, False, 302 * MS)
    assert not mux.zero_due(500 * MS)


def test_a_lock_that_expires_stops_the_robot_as_one_that_is_turned_on() -> None:
    mux = stopping(ONCE)
    assert not mux.zero_due(200 * MS)
    assert mux.zero_due(201 * MS)


def test_no_zero_comes_between_a_source_above_the_lock_and_the_robot() -> None:
    mux = stopping(REPEAT)
    mux.hear(0, GO, 1)
    mux.hear_lock(0, True, 2)
    assert not mux.zero_due(2)
    mux = stopping(REPEAT)
    mux.hear_lock(0, True, 2)
    assert mux.zero_due(2)
    assert mux.hear(0, GO, 3)
    assert not mux.zero_due(500 * MS), "the last one that drove is above the lock, silent or not"


# Configuration


def test_a_mux_without_a_source_or_with_two_of_one_topic_is_refused() -> None:
    with pytest.raises(BadInput, match="there is no source"):
        MuxConfig(())
    with pytest.raises(BadInput, match=r"topics\.a and topics\.b are both /x"):
        MuxConfig((Source("a", "/x", 0.5, 1), Source("b", "/x", 0.5, 2)))
    with pytest.raises(BadInput, match=r"locks\.l\.topic is empty"):
        MuxConfig((Source("a", "/x", 0.5, 1),), (Lock("l", "", 0.0, 1),))


def test_two_locks_may_share_a_topic() -> None:
    """One that stops the low sources early, and one that stops all of them late."""
    mux = mux_of(("low", 0.0, 10), ("high", 0.0, 200), locks=(("soon", 0.1, 100), ("late", 1.0, 255)))
    assert MuxConfig(mux.config.sources, (Lock("soon", "/beat", 0.1, 100), Lock("late", "/beat", 1.0, 255)))


def test_the_mux_of_parameters_has_their_order_and_their_values() -> None:
    config = mux_config(
        MuxParameters(zero_when_locked=REPEAT, zero_period_s=0.2),
        {"b": SourceParameters("/b", 0.5, 3), "a": SourceParameters("/a", 0.0, 300)},
        {"l": LockParameters("/l", 1.5, 7)},
    )
    assert config == MuxConfig(
        (Source("b", "/b", 0.5, 3), Source("a", "/a", 0.0, 300)), (Lock("l", "/l", 1.5, 7),), REPEAT, 0.2
    )


def test_random_schedules_are_reproducible_and_have_expiries_locks_and_ties() -> None:
    """The helper's own: schedules are reproducible, and have expiries, locks and ties."""
    assert random_schedule(np.random.default_rng(5)) == random_schedule(np.random.default_rng(5))
    schedules: list[Schedule] = [random_schedule(np.random.default_rng(seed)) for seed in range(100)]
    assert sum(bool(schedule.config.locks) for schedule in schedules) > 50
