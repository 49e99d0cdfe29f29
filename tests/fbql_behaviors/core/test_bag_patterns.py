"""Observations and commands put together by time, and what is dropped."""

from __future__ import annotations

from math import inf, nan
from typing import Any

import numpy as np
import pytest
import yaml
from fbql_behaviors.core.bag_patterns import Event, patterns_of_bags
from fbql_behaviors.core.bag_spec import spec_of
from fbql_behaviors.core.levels import class_at
from fbql_common.core.errors import BadInput
from hypothesis import given
from hypothesis import strategies as st

S = 10**9
SPEC = spec_of(
    yaml.safe_load("""
max_age_s: 0.5
observations:
  a: {topic: /a, field: x, low: 0.0, high: 10.0}
  b: {topic: /b, field: x, low: 0.0, high: 10.0, max_age_s: 0}
command: {topic: /c, axes: {linear.x: {low: -1.0, high: 1.0, levels: 21}}}
""")
)


def events(*given: tuple[float, str, float]) -> list[Event]:
    """Events of (time [s], topic, number)."""
    return [Event(round(time_s * S), f"/{topic}", (number,)) for time_s, topic, number in given]


def a_bag(commands: int = 20) -> list[tuple[float, str, float]]:
    """A bag in which every command has what it needs."""
    return [(0.0, "b", 1.0)] + [
        each for k in range(commands) for each in ((k, "a", k % 10), (k + 0.1, "c", 0.1 if k % 2 else -0.1))
    ]


def test_a_command_gets_the_last_message_of_each_topic() -> None:
    made = patterns_of_bags(SPEC, [events(*a_bag(), (5.05, "a", 9.5))])
    assert made.patterns.x[4:7].tolist() == [[4.0, 1.0], [9.5, 1.0], [6.0, 1.0]]
    assert made.patterns.wheel_class[:2].tolist() == [class_at(SPEC.commands, (-0.1,)), class_at(SPEC.commands, (0.1,))]
    assert (made.commands, made.dropped, made.clamped) == (20, {}, {})


def test_of_the_same_time_an_observation_comes_first_whatever_the_order_in_the_bag() -> None:
    bag = events(*[(k, topic, 0.1 * (k % 3)) for k in range(20) for topic in "cab"])
    assert np.array_equal(patterns_of_bags(SPEC, [bag]).patterns.x, patterns_of_bags(SPEC, [bag[::-1]]).patterns.x)
    assert patterns_of_bags(SPEC, [bag]).commands == len(patterns_of_bags(SPEC, [bag]).patterns)


def test_what_is_dropped_is_counted_by_reason() -> None:
    bad = [(-1.0, "c", 0.1), (30.0, "c", 0.1), (40.0, "a", nan), (40.1, "c", 0.1), (41.0, "a", inf), (41.1, "c", 0.1)]
    bad += [(42.0, "a", 1.0), (42.1, "c", nan), (42.2, "c", inf)]
    made = patterns_of_bags(SPEC, [events(*a_bag(), *bad)])
    assert made.dropped == {
        "no message on /a yet": 1,
        "/a older than 0.5 s": 1,
        "a not finite": 2,
        "command not finite": 2,
    }
    assert (made.commands, len(made.patterns)) == (26, 20)


def test_a_message_just_old_enough_counts_and_age_0_is_without_end() -> None:
    bag = events(*a_bag(), (100.0, "a", 1.0), (100.5, "c", 0.1), (100.500000001, "c", 0.1))
    assert patterns_of_bags(SPEC, [bag]).dropped == {"/a older than 0.5 s": 1}


def test_what_is_outside_the_limits_counts_as_the_limit_and_is_counted() -> None:
    made = patterns_of_bags(SPEC, [events(*a_bag(), (50.0, "a", 10.0), (50.1, "c", 7.0))])
    assert made.clamped == {"a": 1, "linear.x": 1}
    assert made.patterns.wheel_class.max() == class_at(SPEC.commands, (1.0,))


def test_a_bag_is_a_demonstration_and_a_single_one_five() -> None:
    several = patterns_of_bags(SPEC, [events(*a_bag(10)), events(*a_bag(12))]).patterns
    assert several.demonstration.tolist() == [0] * 10 + [1] * 12
    assert patterns_of_bags(SPEC, [events(*a_bag(20))]).patterns.demonstration.tolist() == sorted([0, 1, 2, 3, 4] * 4)


def test_of_two_bags_none_knows_what_the_other_sensed() -> None:
    second = [each for each in a_bag(12) if each[1] != "b"]
    made = patterns_of_bags(SPEC, [events(*a_bag(10)), events(*second)])
    assert made.dropped == {"no message on /b yet": 12}


def test_every_nth_command_and_at_most_so_many_are_taken() -> None:
    bag = [events(*a_bag(60))]
    assert patterns_of_bags(SPEC, bag, every=3).patterns.x[:, 0].tolist() == [float(k % 10) for k in range(0, 60, 3)]
    assert len(patterns_of_bags(SPEC, bag, count=17).patterns) == 17


REFUSED: dict[str, tuple[list[tuple[float, str, float]], str]] = {
    "no command": ([(0.0, "a", 1.0), (0.0, "b", 1.0)], "topic /c has no message"),
    "no observation": ([(0.0, "c", 1.0), (0.0, "b", 1.0)], "topic /a has no message"),
    "no overlap": (
        [(float(k), "b", 1.0) for k in range(3)] + [(k, "c", 0.1) for k in range(20)] + [(30.0, "a", 1.0)],
        "no overlap in time: /c is recorded from 0.0 to 19.0 s, /a from 30.0 to 30.0 s",
    ),
    "too few": (
        [*a_bag(4), (20.0, "c", 0.1)],
        "4 patterns of 5 commands on /c, at least 10 are needed (dropped: /a older",
    ),
    "constant": (
        [(t, topic, 0.31 + t * 1e-4 if topic == "c" else x) for t, topic, x in a_bag()],
        "command /c is the same in all 20 patterns (linear.x 0.31001, rounded to its levels)",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_nothing_can_be_learned_from_is_refused_with_the_reason(name: str) -> None:
    given, problem = REFUSED[name]
    with pytest.raises(BadInput) as refused:
        patterns_of_bags(SPEC, [events(*given)])
    assert problem in str(refused.value)


def latest_slowly(bag: list[tuple[float, str, float]], topic: str, time_s: float) -> tuple[float, float] | None:
    """The literal oracle: time and number of a topic's last message at or before a time."""
    before = [(t, x) for t, of, x in bag if of == topic and t <= time_s]
    return max(before, key=lambda each: each[0]) if before else None


@given(st.data())
def test_any_bag_gives_what_the_rule_says(data: Any) -> None:
    times = data.draw(st.lists(st.integers(0, 400), min_size=40, max_size=80, unique=True))
    topics = data.draw(st.lists(st.sampled_from("abcc"), min_size=len(times), max_size=len(times)))
    bag = [(t / 20, topic, float(t % 10) / 10) for t, topic in zip(times, topics, strict=True)]
    expected: list[list[float]] = []
    for time_s, _, _ in sorted(each for each in bag if each[1] == "c"):
        a, b = latest_slowly(bag, "a", time_s), latest_slowly(bag, "b", time_s)
        if a and b and round((time_s - a[0]) * S) <= S // 2:
            expected.append([a[1], b[1]])
    try:
        made = patterns_of_bags(SPEC, [events(*bag)])
    except BadInput:
        commands = {number for _, topic, number in bag if topic == "c"}
        assert len(expected) < 10 or len(commands) <= len(expected)
        return
    assert made.patterns.x.tolist() == expected
