"""A mux that learns: what is decided holds only among the sources that twist_mux's rules leave, and nothing old is passed on."""

from __future__ import annotations

import re
from itertools import accumulate
from math import inf, nan
from typing import Any

import mux_oracle
import numpy as np
import pytest
import yaml
from fbql_common.core.command_space import Axis, CommandSpace
from fbql_common.core.errors import BadInput
from fbql_common.core.mux_types import RobotOutcome
from fbql_common.core.twist import Twist
from fbql_fusion.core.mux.config import Lock, Source, rank
from fbql_fusion.core.mux.learned import SILENT_NS, LearnedMux, Ticked
from fbql_fusion.core.mux.learning import MuxDescription, description_of, session_of
from fbql_fusion.core.mux.mux import Mux
from mux_oracle import STEP_NS, Event, random_schedule
from places import ROOT
from rail import at

MS = 1_000_000
PERIOD_NS = 100 * MS
SUCCESS = RobotOutcome(0, 10.0, terminated=True, outcome="success")
OBSERVATIONS = {
    "front": {
        "topic": "/scan",
        "type": "sensor_msgs/msg/LaserScan",
        "field": "ranges[0:9].min",
        "low": 0.0,
        "high": 3.0,
    },
    "goal": {
        "topic": "/goal",
        "type": "std_msgs/msg/Float64",
        "field": "data",
        "low": -1.0,
        "high": 1.0,
        "max_age_s": 0.0,
    },
}


def topics(**sources: tuple[float, int]) -> dict[str, Any]:
    """The parameters of sources, each of (timeout, priority)."""
    return {
        name: {"topic": f"/{name}", "timeout": timeout_s, "priority": priority}
        for name, (timeout_s, priority) in sources.items()
    }


def described(sources: dict[str, Any], locks: dict[str, Any] | None = None, **values: Any) -> MuxDescription:
    """A mux that learns."""
    given = {"learn": True, "topics": sources, "locks": locks or {}, "observations": OBSERVATIONS, **values}
    return description_of(given, "test")


def made(description: MuxDescription) -> LearnedMux:
    """Its mux."""
    learned = description.learned
    session = session_of(description, None)
    mux = Mux(description.config)
    return LearnedMux(mux, session, description.robot, learned.safety_priority, learned.segment_s)


def two(**values: Any) -> LearnedMux:
    """Of two sources, a and b, below a joystick, under a lock; a is held for ever unless something forces a change."""
    lock = {"stop": {"topic": "/stop", "timeout": 0.0, "priority": 50}}
    sources = topics(a=(0.5, 10), b=(0.5, 20), joystick=(0.5, 100))
    given = {"hold_s": 1000.0, "play_s": 1000.0, "controller": "priorities", "fbql_mirror": False, **values}
    mux = made(described(sources, lock, **given))
    mux.has_episodes = True
    return mux


A, B, JOYSTICK = 0, 1, 2


def go(speed: float) -> Twist:
    """A command."""
    return Twist(speed)


def driver(ticked: list[Ticked]) -> int:
    """Whom the last decision names."""
    return ticked[-1].decision.driver


# Who drives between ticks


def test_before_the_first_tick_only_a_source_at_or_above_safety_priority_drives() -> None:
    mux = two()
    assert not mux.hear(A, go(0.1), 0)
    assert mux.hear(JOYSTICK, go(0.2), 0)


def test_the_chosen_source_drives_until_the_next_tick_each_command_once() -> None:
    mux = two()
    assert not mux.hear(A, go(0.1), 0)
    assert not mux.hear(B, go(0.2), 0)
    (ticked,) = mux.tick(at(1, 1))
    assert (ticked.decision.driver, ticked.pass_on) == (B, B), (
        "the priority decides here, and the tick passes its last one on"
    )
    assert not mux.hear(A, go(0.1), 2)
    assert mux.hear(B, go(0.2), 2)
    (ticked,) = mux.tick(at(3, 3))
    assert (ticked.decision.driver, ticked.pass_on, ticked.send) == (B, None, None), "already passed on"
    (ticked,) = mux.tick(at(3 + 500 * MS, 4))
    assert ticked.decision.driver == -1, "both have expired"
    assert not mux.hear(A, go(0.1), 3 + 501 * MS), "nobody is chosen"


def test_a_source_at_or_above_safety_priority_drives_whatever_is_chosen() -> None:
    mux = two()
    mux.hear(B, go(0.2), 0)
    mux.tick(at(1, 1))
    assert mux.hear(JOYSTICK, go(0.9), 2)
    assert not mux.hear(B, go(0.2), 3)
    (ticked,) = mux.tick(at(4, 4))
    assert ticked.decision.overruled_by == "joystick"
    assert (ticked.decision.driver, ticked.pass_on, ticked.send) == (-1, None, None)
    assert ticked.decision.active == (False, False)
    assert not mux.hear(B, go(0.2), 5)
    later = 2 + 500 * MS + 1
    assert not mux.hear(B, go(0.3), later), "the joystick has expired, but nobody is chosen before the next tick"
    (ticked,) = mux.tick(at(later, later))
    assert (ticked.decision.driver, ticked.pass_on) == (B, B)


def test_a_lock_stops_the_chosen_source_at_once_and_masks_it_in_the_next_decision() -> None:
    mux = two()
    mux.hear(B, go(0.2), 0)
    mux.tick(at(1, 1))
    mux._mux.hear_lock(0, on=True, received_ns=2)
    assert not mux.hear(B, go(0.2), 3)
    (ticked,) = mux.tick(at(4, 4))
    assert (ticked.decision.active, ticked.pass_on) == ((False, False), None)
    assert mux.hear(JOYSTICK, go(0.2), 5), "it stands above the lock"
    mux._mux.hear_lock(0, on=False, received_ns=6)


def test_what_a_source_said_while_a_lock_was_on_is_passed_on_by_a_later_tick_only_if_it_is_not_too_old() -> None:
    mux = two()
    mux._mux.hear_lock(0, on=True, received_ns=0)
    mux.hear(B, go(0.2), 0)
    mux._mux.hear_lock(0, on=False, received_ns=1)
    (ticked,) = mux.tick(at(500 * MS, 500 * MS))
    assert ticked.pass_on == B
    mux.hear(A, go(0.2), 600 * MS)
    (ticked,) = mux.tick(at(1101 * MS, 0))
    assert ticked.decision.driver == -1


def test_a_source_without_a_timeout_counts_as_silent_after_a_second() -> None:
    mux = made(described(topics(a=(0.0, 10), b=(0.5, 5)), controller="priorities"))
    mux.hear(A, go(0.1), 0)
    mux.hear(B, go(0.1), SILENT_NS)
    (ticked,) = mux.tick(at(SILENT_NS, 1))
    assert ticked.decision.active == (True, True)
    (ticked,) = mux.tick(at(SILENT_NS + 1, 2))
    assert (ticked.decision.active, ticked.decision.driver) == ((False, True), 1)


def test_a_blend_is_sent_at_each_tick_and_nothing_is_passed_on() -> None:
    mux = two(controller="uniform")
    mux.hear(A, Twist(0.2, angular_z_rad_s=1.0), 0)
    mux.hear(B, Twist(0.4, angular_z_rad_s=-1.0), 0)
    (ticked,) = mux.tick(at(1, 1))
    assert ticked.send is not None
    assert ticked.send == pytest.approx(Twist(0.3))
    assert not mux.hear(A, go(0.1), 2)
    assert not mux.hear(B, go(0.1), 2)


def test_a_robot_that_a_blend_drove_gets_a_zero_when_a_lock_stops_all_of_it_and_when_the_episode_ends() -> None:
    mux = two(controller="uniform", zero_when_locked="once")
    mux.hear(A, go(0.2), 0)
    mux.hear(B, go(0.4), 0)
    mux.tick(at(1, 1))
    mux._mux.hear_lock(0, on=True, received_ns=2)
    assert mux._mux.zero_due(2), "the lock stands above both"
    mux._mux.hear_lock(0, on=False, received_ns=3)
    mux.tick(at(3, 3))
    mux.hear_outcome(SUCCESS)
    (ticked,) = mux.tick(at(4, 4))
    assert ticked.send == Twist()


def test_a_lock_that_leaves_a_part_of_a_blend_does_not_interrupt_it() -> None:
    lock = {"stop": {"topic": "/stop", "timeout": 0.0, "priority": 15}}
    mux = made(described(topics(b=(0.5, 20), a=(0.5, 10)), lock, controller="uniform", zero_when_locked="repeat"))
    mux.hear(0, go(0.2), 0)
    mux.hear(1, go(0.4), 0)
    mux.tick(at(1, 1))
    mux._mux.hear_lock(0, on=True, received_ns=2)
    assert not mux._mux.zero_due(2)
    (ticked,) = mux.tick(at(3, 3))
    assert ticked.send == Twist(0.2)


def test_ages_are_those_after_what_is_learned_between_two_episodes() -> None:
    for cut in (False, True):
        mux = two(segment_s=0.1)
        mux.has_episodes = not cut
        now_ns = 0
        mux.hear(B, go(0.2), now_ns)
        mux.tick(lambda: (now_ns, now_ns))  # noqa: B023 - called at once
        begin = mux.session.next_episode

        def learn() -> tuple[int, int] | None:
            nonlocal now_ns
            now_ns += 501 * MS
            return begin()  # noqa: B023 - called in this round

        mux.session.next_episode = learn
        now_ns = PERIOD_NS
        mux.hear(A, go(0.3), now_ns)
        if not cut:
            mux.hear_outcome(SUCCESS)
            mux.tick(lambda: (now_ns, now_ns))  # noqa: B023
        last = mux.tick(lambda: (now_ns, now_ns))[-1]  # noqa: B023
        assert (last.decision.episode, last.decision.stamp_ns) == (1, PERIOD_NS + 501 * MS)
        assert (last.decision.active, last.pass_on) == ((False, False), None), "both have expired meanwhile"


def test_what_waited_while_the_mux_was_busy_is_as_old_as_it_is() -> None:
    mux = two()
    mux.hear(A, go(0.3), 600 * MS, 500 * MS)
    assert not mux.hear(JOYSTICK, go(0.9), 600 * MS, 0), "not even one that is never learned over"
    mux.hear(B, go(0.2), 600 * MS, 0)
    mux.hear_observation(0, 1.0, 0)
    (ticked,) = mux.tick(at(601 * MS, 1))
    assert (ticked.decision.active, ticked.pass_on) == ((True, False), A)
    assert ticked.decision.ages_s == pytest.approx((0.101, 0.601))
    assert np.isnan(ticked.decision.observed[0])
    assert not mux.hear(A, go(0.3), 1200 * MS, 650 * MS), "the chosen one has died while the mux was busy"


# Random schedules, against the rules stated a second time


def learned_over(seed: int) -> tuple[int, int, int]:
    """Plays a random schedule with a mux that draws its drivers. Returns how many commands were passed on: of safe sources, of
    others when they came, of others by a tick."""
    generator = np.random.default_rng((41, seed))
    schedule = random_schedule(generator)
    sources = {source.name: source for source in schedule.config.sources}
    safety = int(generator.choice([10, 50, 255]))
    ordinary = [source for source in sources.values() if 0 < rank(source) < safety]
    if not ordinary:
        return 0, 0, 0
    entries = {
        kind: {each.name: {"topic": each.topic, "timeout": each.timeout_s, "priority": each.priority} for each in found}
        for kind, found in (("topics", schedule.config.sources), ("locks", schedule.config.locks))
    }
    mux = made(
        described(entries["topics"], entries["locks"], safety_priority=safety, seed=seed, hold_s=0.0, segment_s=0.15)
    )
    names, locks = list(sources), [lock.name for lock in schedule.config.locks]
    counts = [0, 0, 0]
    last: dict[str, tuple[int, int]] = {}
    """Time and place of the last command of each source."""
    passed: set[int] = set()

    def check(name: str, events: list[Event], now_ns: int) -> None:
        source = sources[name]
        assert may_drive(source, schedule.config.locks, events, now_ns), f"schedule {seed}"
        heard_ns, place = last[name]
        assert source.timeout_s <= 0 or now_ns - heard_ns <= source.timeout_s * 1e9
        assert place not in passed, "twice"
        passed.add(place)

    for place, event in enumerate(schedule.events):
        now_ns, before = event.time_ns, schedule.events[: place + 1]
        if event.on is not None:
            mux._mux.hear_lock(locks.index(event.name), event.on, now_ns)
        else:
            last[event.name] = now_ns, place
            drives = mux.hear(names.index(event.name), go(float(place)), now_ns)
            wins = mux_oracle.driver(schedule.config.sources, schedule.config.locks, before, now_ns)
            is_safe = wins is not None and rank(sources[wins]) >= safety
            if rank(sources[event.name]) >= safety:
                assert drives == (wins == event.name)
                counts[0] += drives
            elif drives:
                assert not is_safe, "learned over a source that is never learned over"
                check(event.name, before, now_ns)
                counts[1] += 1
        for _ in range(int(generator.integers(0, 3))):
            for ticked in mux.tick(at(now_ns, now_ns)):
                wins = mux_oracle.driver(schedule.config.sources, schedule.config.locks, before, now_ns)
                is_safe = wins is not None and rank(sources[wins]) >= safety
                assert ticked.decision.overruled_by == (wins if is_safe else "")
                if ticked.pass_on is not None:
                    assert not is_safe
                    check(names[ticked.pass_on], before, now_ns)
                    counts[2] += 1
            now_ns += STEP_NS if place + 1 == len(schedule.events) else 0
    return counts[0], counts[1], counts[2]


def may_drive(source: Source, locks: tuple[Lock, ...], events: list[Event], now_ns: int) -> bool:
    """Whether the rules leave a source, by the oracle: alone, it would drive."""
    return mux_oracle.driver([source], locks, events, now_ns) == source.name


def test_in_random_schedules_no_rule_is_ever_learned_over_and_nothing_is_passed_on_twice() -> None:
    totals = [sum(each) for each in zip(*(learned_over(seed) for seed in range(150)), strict=True)]
    assert min(totals) > 100, totals


@pytest.mark.long
@pytest.mark.timeout(3600)
def test_in_ten_thousand_random_schedules_no_rule_is_ever_learned_over() -> None:
    for seed in range(10_000):
        learned_over(seed)


def killed(times: int) -> list[int]:
    """Kills the driving source again and again; returns the ages of all commands that went out [ns]."""
    timeout_ns = 200 * MS
    mux = made(described(topics(a=(0.2, 10), b=(0.2, 20)), fbql_prior=1.0, seed=1))
    generator = np.random.default_rng(8)
    now_ns, last, ages = 0, [0, 0], list[int]()
    for _ in range(times):
        lives = int(generator.integers(1, 12)), int(generator.integers(1, 12))
        for beat in range(int(generator.integers(12, 24))):
            now_ns += int(generator.integers(1, 80)) * MS
            for index in (A, B):
                if beat < lives[index]:
                    last[index] = now_ns
                    if mux.hear(index, go(0.3), now_ns):
                        ages.append(0)
            for ticked in mux.tick(at(now_ns, now_ns)):
                if ticked.pass_on is not None:
                    ages.append(now_ns - last[ticked.pass_on])
    assert max(ages) <= timeout_ns
    return ages


def test_of_a_source_that_was_killed_nothing_older_than_its_timeout_is_passed_on() -> None:
    assert len(killed(1000)) > 3000


# Rewards and episodes


def test_rewards_since_the_last_tick_add_up_and_an_end_closes_the_episode_at_the_next_tick() -> None:
    mux = two()
    mux.hear_outcome(RobotOutcome(0, 99.0))
    mux.hear(B, go(0.2), 0)
    (ticked,) = mux.tick(at(1, 1))
    assert ticked.decision.reward == 0.0, "nothing was decided before"
    mux.hear_outcome(RobotOutcome(0, 1.0))
    mux.hear_reward(0.5)
    (ticked,) = mux.tick(at(2, 2))
    assert (ticked.decision.episode, ticked.decision.step, ticked.decision.reward) == (0, 1, 1.5)
    mux.hear_reward(2.0)
    mux.hear_outcome(SUCCESS)
    mux.hear_reward(7.0)
    (ticked,) = mux.tick(at(3, 3))
    assert (ticked.decision.reward, ticked.decision.terminated, ticked.decision.outcome) == (12.0, True, "success")
    assert ticked.send == Twist(), "the robot stops"
    assert not mux.hear(B, go(0.2), 4), "nobody drives until the next tick"
    (ticked,) = mux.tick(at(5, 5))
    assert (ticked.decision.episode, ticked.decision.step, ticked.decision.reward) == (1, 0, 0.0)
    assert mux.session.summary().successes == 1


def test_an_end_while_a_safe_source_drives_sends_no_zero() -> None:
    mux = two()
    mux.hear(B, go(0.2), 0)
    mux.tick(at(1, 1))
    mux.hear(JOYSTICK, go(0.9), 2)
    mux.hear_outcome(SUCCESS)
    (ticked,) = mux.tick(at(3, 3))
    assert (ticked.decision.terminated, ticked.send) == (True, None)


def test_where_nobody_says_when_episodes_end_they_are_cut_without_stopping_the_robot() -> None:
    mux = two(segment_s=0.3)
    mux.has_episodes = False
    decisions = []
    for k in range(8):
        now_ns = k * PERIOD_NS
        mux.hear(B, go(0.2), now_ns)
        ticked = mux.tick(at(now_ns, now_ns))
        assert all(each.send is None for each in ticked)
        assert driver(ticked) == 1
        decisions += [(d.episode, d.step, d.truncated) for d in (each.decision for each in ticked)]
    assert decisions == [
        (0, 0, False), (0, 1, False), (0, 2, False), (0, 3, True), (1, 0, False), (1, 1, False), (1, 2, False),
        (1, 3, True), (2, 0, False), (2, 1, False),
    ]  # fmt: skip


def played(mux: LearnedMux, ticks: int, now_ns: int, told: int = 1, rewarded: int = 0) -> list[Ticked]:
    """Ticks in which both sources drive, with this many nodes that publish outcomes, and rewards alone."""
    found: list[Ticked] = []
    for k in range(ticks):
        at_ns = now_ns + k * PERIOD_NS
        mux.hear(A, go(0.1), at_ns)
        mux.hear(B, go(0.2), at_ns)
        mux.hear_observation(0, 1.0, at_ns)
        mux.hear_observation(1, 0.5, at_ns)
        mux.look(told, rewarded)
        found += mux.tick(at(at_ns, at_ns))
    return found


def in_short(ticked: list[Ticked]) -> list[tuple[int, int, bool, bool]]:
    """Episode, step, whether it is truncated and whether nothing more is learned."""
    return [(d.episode, d.step, d.truncated, d.degraded) for d in (each.decision for each in ticked)]


def episodes_learned(mux: LearnedMux) -> int:
    """How many episodes the learner has taken."""
    policy = mux.session.policy()
    assert policy is not None
    return int(policy.arrays["counts"][0])


def test_where_those_who_tell_outcomes_have_gone_the_episode_ends_and_nothing_of_it_is_learned() -> None:
    mux = two(controller="fbql", segment_s=0.3, hold_s=0.0)
    played(mux, 3, 0)
    mux.hear_outcome(SUCCESS)
    assert in_short(played(mux, 4, 3 * PERIOD_NS))[-1] == (1, 2, False, False)
    assert episodes_learned(mux) == 1
    lost = played(mux, 9, 7 * PERIOD_NS, told=0)
    assert in_short(lost) == [
        (1, 4, True, True), (2, 0, False, False), (2, 2, False, True), (2, 3, False, True),
        (2, 4, True, True), (3, 0, False, False), (3, 2, False, True), (3, 3, False, True),
        (3, 4, True, True), (4, 0, False, False), (4, 2, False, True), (4, 3, False, True),
    ]  # fmt: skip
    assert all(each.send is None for each in lost), "the robot is not stopped"
    mux.hear_outcome(SUCCESS)
    played(mux, 1, 16 * PERIOD_NS, told=0)
    assert episodes_learned(mux) == 1, "not even what somebody tells whom nobody knows"
    back = played(mux, 3, 17 * PERIOD_NS)
    assert in_short(back)[-3:] == [(6, 0, False, False), (6, 1, False, False), (6, 2, False, False)], (
        "a new one begins when somebody is there again"
    )
    mux.hear_outcome(SUCCESS)
    played(mux, 1, 20 * PERIOD_NS)
    assert episodes_learned(mux) == 2
    assert [record.degraded for record in mux.session.records] == [False, True, True, True, True, True, False]


def test_what_those_who_have_gone_told_before_is_learned() -> None:
    mux = two(controller="fbql", hold_s=0.0)
    played(mux, 3, 0)
    mux.hear_outcome(SUCCESS)
    assert in_short(played(mux, 1, 3 * PERIOD_NS, told=0))[0] == (0, 3, False, False)
    assert (episodes_learned(mux), mux.session.summary().successes) == (1, 1)


def test_rewards_are_learned_from_where_those_who_told_outcomes_have_gone() -> None:
    mux = two(controller="fbql", segment_s=0.2, hold_s=0.0)
    played(mux, 3, 0, rewarded=1)
    found = in_short(played(mux, 4, 3 * PERIOD_NS, told=0, rewarded=1))
    assert found == [
        (0, 4, True, True), (1, 0, False, False), (1, 1, False, False), (1, 2, True, False), (2, 0, False, False),
        (2, 1, False, False),
    ]  # fmt: skip
    assert episodes_learned(mux) == 1
    assert in_short(played(mux, 1, 7 * PERIOD_NS, told=0))[0] == (2, 3, True, True), "the rewards have gone, too"


@pytest.mark.parametrize(("looks", "is_missed"), [(1, False), (2, True)])
def test_who_was_there_at_two_looks_in_a_row_is_missed(looks: int, is_missed: bool) -> None:
    mux = two()
    for publishers in [1, 0, *[1] * looks]:
        assert not mux.look(publishers, 0)
    assert mux.look(0, 0) == is_missed
    assert mux.is_lost == is_missed


def test_one_who_tells_an_outcome_and_goes_is_not_missed() -> None:
    mux = two(controller="fbql", segment_s=0.2, hold_s=0.0)
    played(mux, 1, 0, told=0)
    mux.hear_outcome(RobotOutcome(0, 1.0))
    played(mux, 1, PERIOD_NS, told=1)
    found = in_short(played(mux, 6, 2 * PERIOD_NS, told=0))
    assert found[-1] == (0, 7, False, False)


def test_an_episode_in_which_the_clock_was_set_back_is_cut() -> None:
    mux = two(segment_s=0.3)
    mux.has_episodes = False
    late_ns = 10**12
    assert [driver(mux.tick(at(now_ns, now_ns))) for now_ns in (late_ns, late_ns + PERIOD_NS)] == [-1, -1]
    ended, begun = mux.tick(at(5 * PERIOD_NS, 0))
    assert (ended.decision.truncated, ended.decision.step) == (True, 2)
    assert (begun.decision.episode, begun.decision.step) == (1, 0)
    mux.tick(at(6 * PERIOD_NS, 0))
    mux.tick(at(7 * PERIOD_NS, 0))
    assert mux.tick(at(8 * PERIOD_NS, 0))[0].decision.truncated, "after its time, by the new clock"


def test_the_last_episode_stops_the_robot_also_where_it_is_cut() -> None:
    mux = two(segment_s=0.1, episodes=1)
    mux.has_episodes = False
    mux.hear(B, go(0.2), 0)
    mux.tick(at(0, 0))
    (ticked,) = mux.tick(at(PERIOD_NS, 1))
    assert (ticked.decision.truncated, ticked.send) == (True, Twist())
    assert mux.is_done


def test_after_the_last_episode_there_are_no_decisions_and_only_safe_sources_drive() -> None:
    mux = two(episodes=1)
    mux.hear(B, go(0.2), 0)
    mux.tick(at(1, 1))
    mux.hear_outcome(SUCCESS)
    mux.tick(at(2, 2))
    assert not mux.is_done
    assert mux.tick(at(3, 3)) == []
    assert mux.is_done
    assert not mux.hear(B, go(0.2), 4)
    assert mux.hear(JOYSTICK, go(0.2), 5)


# Observations


@pytest.mark.parametrize(("value", "seen"), [(1.5, 1.5), (-1.0, 0.0), (7.0, 3.0), (inf, 3.0), (-inf, 0.0), (nan, nan)])
def test_an_observation_counts_within_its_limits_and_for_its_time(value: float, seen: float) -> None:
    mux = two()
    mux.hear_observation(0, value, 10)
    mux.hear_observation(1, 0.25, 10)
    (ticked,) = mux.tick(at(10 + 500 * MS, 1))
    assert ticked.decision.observed == pytest.approx((seen, 0.25), nan_ok=True)
    (ticked,) = mux.tick(at(11 + 500 * MS, 2))
    assert ticked.decision.observed == pytest.approx((nan, 0.25), nan_ok=True), "any age will do for the second"
    (ticked,) = mux.tick(at(9, 3))
    assert ticked.decision.observed == pytest.approx((nan, 0.25), nan_ok=True), "the clock was set back"


def test_observations_of_a_group_are_learned_together_in_the_order_in_which_groups_begin() -> None:
    every = {**OBSERVATIONS["goal"], "group": "target"}
    given = {"bearing": every, "distance": every, "front": OBSERVATIONS["front"]}
    robot = described(topics(a=(0.5, 1)), observations={"x": OBSERVATIONS["front"], **given}).robot
    assert robot.lengths == (1, 2, 1)
    assert [each.name for each in robot.observations] == ["x", "bearing", "distance", "front"]
    assert [robot.place_of(name) for name in ("x", "distance", "front", "y")] == [(0, 0), (1, 1), (2, 0), None]
    assert [*accumulate(robot.lengths)] == [1, 3, 4]


# Parameters


def test_without_axes_the_robot_is_a_differential_drive() -> None:
    assert described(topics(a=(0.5, 10))).robot.space == CommandSpace(
        (Axis("linear.x", "m/s", -1.0, 1.0, 5), Axis("angular.z", "rad/s", -2.0, 2.0, 5))
    )


def test_a_condition_may_allow_a_single_value() -> None:
    source = topics(b=(0.5, 1))["b"] | {"guide_observation": "goal", "guide_low": 0.5, "guide_high": 0.5}
    mux = made(described(topics(a=(0.5, 10)) | {"b": source}, controller="priorities"))
    assert mux.session.behaviors == ("a", "b")


def test_a_description_is_made_again_of_its_values() -> None:
    description = described(topics(a=(0.5, 10)), axes={"linear_x": {"low": -0.2, "high": 0.8, "levels": 7}}, seed=4)
    assert description_of(description.values(), "again") == description


def test_the_example_of_the_page_can_be_learned() -> None:
    page = (ROOT / "docs" / "mux.md").read_text()
    (block,) = [each for each in re.findall(r"```yaml\n(.*?)```", page, re.DOTALL) if "learn: true" in each]
    mux = made(description_of(yaml.safe_load(block)["twist_mux"]["ros__parameters"], "docs/mux.md"))
    assert mux.session.behaviors == ("goal", "gap", "back")
    mux.hear(0, go(0.5), 0)
    mux.hear(1, go(0.2), 0)
    mux.hear_observation(2, 0.5, 0)
    (ticked,) = mux.tick(at(1, 1))
    assert ticked.decision.learned_weights[1] > 0.9, "the priorities would take gap here"


@pytest.mark.parametrize(
    ("values", "reason"),
    [
        ({"behaviors": ["c"]}, "'behaviors' has 'c', which is not one of the sources (a, joystick)"),
        ({"behaviors": ["joystick"]}, "'joystick', whose priority is 100; it must be above 0 and below safety_priority"),
        ({"behaviors": ["a", "a"]}, "'behaviors' names 'a' twice"),
        ({"sources": topics(a=(0.5, 0), joystick=(0.5, 100))}, "there is no source below safety_priority"),
        ({"behaviors": ["idle"], "sources": topics(idle=(0.5, 0), a=(0.5, 1))}, "'idle', whose priority is 0; it must be above 0"),
        ({"safety_priority": 10}, "there is no source below safety_priority, so there is nothing to decide"),
        ({"axes": {"linear_w": {"low": 0.0, "high": 1.0}}}, "'axes.linear_w': not an axis of a Twist"),
        ({"axes": {"linear_x": {"low": 1.0, "high": 1.0}}}, "'axes.linear_x.low' is 1, not below 'high' (1)"),
        ({"observations": {"o": OBSERVATIONS["goal"] | {"field": "a..b"}}}, "'observations.o.field': 'a..b' is not the path"),
        ({"observations": {"o": OBSERVATIONS["goal"] | {"low": 2.0}}}, "'observations.o.low' is 2, not below 'high' (1)"),
        ({"observations": OBSERVATIONS | {"o": OBSERVATIONS["goal"] | {"topic": "/scan"}}}, "'observations.o.type' is std_msgs/msg/Float64, but another observation of /scan has sensor_msgs/msg/LaserScan"),
        ({"sources": {"b": topics(b=(0.5, 1))["b"] | {"guide_observation": "goal", "guide_low": 1.0, "guide_high": 0.5}}}, "'topics.b.guide_low' is 1, above 'guide_high' (0.5)"),
        ({"observations": {"o": {"topc": 1}}}, "unknown parameter 'topc'"),
        ({"sources": topics(a=(0.5, 10)) | {"b": topics(b=(0.5, 1))["b"] | {"guide_observation": "x"}}}, "'topics.b.guide_observation' is 'x'"),
        ({"observations": [1]}, "'observations' is not a mapping of names"),
    ],
)  # fmt: skip
def test_wrong_parameters_are_refused_in_one_line(values: dict[str, Any], reason: str) -> None:
    with pytest.raises(BadInput) as refusal:
        made(described(**{"sources": topics(a=(0.5, 10), joystick=(0.5, 100)), **values}))
    assert reason in str(refusal.value)
    assert "\n" not in str(refusal.value)
