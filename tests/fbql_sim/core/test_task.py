"""Starts, wheel disturbance, events and the two kinds of end."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from math import hypot
from statistics import mean, stdev

import pytest
from fbql_common.core.errors import BadInput
from fbql_common.core.field import BALL_RADIUS_M, FIELD, FREE_BALL_SPOTS_M
from fbql_common.core.parameters import check
from fbql_sim.core.parameters import SimulationParameters
from fbql_sim.core.task import Events, Task

DEFAULTS = SimulationParameters()
LINE = FIELD.half_length_m
PAST_LINE = LINE + BALL_RADIUS_M + 1e-6


def begun_task(**changes: float) -> Task:
    task = Task(replace(DEFAULTS, **changes))
    task.begin(1)
    return task


def test_defaults_are_within_their_bounds() -> None:
    check(DEFAULTS, "defaults")


# Starts


def test_starts_use_all_four_spots_about_equally_and_are_never_the_same() -> None:
    task = Task(DEFAULTS)
    starts = [task.begin(seed) for seed in range(400)]
    spots = Counter(
        min(FREE_BALL_SPOTS_M, key=lambda spot: hypot(spot[0] - start.ball_x_m, spot[1] - start.ball_y_m))
        for start in starts
    )
    assert set(spots) == set(FREE_BALL_SPOTS_M)
    assert min(spots.values()) > 70
    assert len(set(starts)) == len(starts)


def test_robot_starts_before_its_goal_line_facing_the_field_within_its_jitter() -> None:
    task = Task(DEFAULTS)
    starts = [task.begin(seed) for seed in range(400)]
    distances = [start.robot_x_m + LINE for start in starts]
    assert all(0.05 <= distance <= 0.15 for distance in distances)
    assert max(distances) - min(distances) > 0.09
    for values, limit in (
        ([start.robot_y_m for start in starts], DEFAULTS.start_robot_y_jitter_m),
        ([start.robot_yaw_rad for start in starts], DEFAULTS.start_yaw_jitter_rad),
    ):
        assert -limit <= min(values) < -0.9 * limit
        assert 0.9 * limit < max(values) <= limit


def test_without_jitter_there_are_only_four_starts() -> None:
    still = replace(
        DEFAULTS,
        start_distance_low_m=0.1,
        start_distance_high_m=0.1,
        start_robot_y_jitter_m=0.0,
        start_yaw_jitter_rad=0.0,
        start_ball_jitter_m=0.0,
    )
    task = Task(still)
    assert {(start.ball_x_m, start.ball_y_m) for start in (task.begin(seed) for seed in range(100))} == set(
        FREE_BALL_SPOTS_M
    )
    assert len({task.begin(seed) for seed in range(100)}) == 4


def test_start_distances_in_the_wrong_order_are_bad_input() -> None:
    with pytest.raises(BadInput, match="start_distance_low_m"):
        Task(replace(DEFAULTS, start_distance_low_m=0.2))


# Wheel disturbance


def test_each_wheel_has_a_gain_of_its_episode_and_a_noise_of_its_step() -> None:
    task = Task(DEFAULTS)
    means = list[float]()
    for seed in range(60):
        task.begin(seed)
        lefts, rights = zip(*(task.disturb(10.0, -20.0) for _ in range(600)), strict=True)
        for gains in ([left / 10 for left in lefts], [right / -20 for right in rights]):
            assert stdev(gains) == pytest.approx(DEFAULTS.wheel_noise_deviation, rel=0.15)
            means.append(mean(gains))
    assert mean(means) == pytest.approx(1.0, abs=0.01)
    assert stdev(means) == pytest.approx(DEFAULTS.wheel_gain_deviation, rel=0.3)


def test_without_disturbance_the_wheels_do_as_told() -> None:
    task = begun_task(wheel_gain_deviation=0.0, wheel_noise_deviation=0.0)
    assert [tuple(task.disturb(3.0, -4.0)) for _ in range(300)] == [(3.0, -4.0)] * 300


@pytest.mark.parametrize("steps", [1, 3])
def test_a_delayed_command_moves_the_wheels_that_much_later(steps: int) -> None:
    task = begun_task(
        wheel_gain_deviation=0.0, wheel_noise_deviation=0.0, command_delay_s=(steps + 0.4) * DEFAULTS.dt_s
    )
    found = [task.disturb(float(k), -float(k)) for k in range(1, 10)]
    assert found == [(0.0, 0.0)] * steps + [(float(k), -float(k)) for k in range(1, 10 - steps)]
    task.begin(1)
    assert task.disturb(5.0, 5.0) == (0.0, 0.0), "a command of the episode before is never followed"


# Events


@pytest.mark.parametrize(
    ("x", "y", "goal", "own_goal"),
    [
        (0.0, 0.0, False, False),
        (LINE + 0.5 * BALL_RADIUS_M, 0.0, False, False),
        (PAST_LINE, 0.0, True, False),
        (PAST_LINE, -0.17, True, False),
        (-LINE - 0.5 * BALL_RADIUS_M, 0.1, False, False),
        (-PAST_LINE, 0.1, False, True),
    ],
)
def test_a_goal_counts_when_the_whole_ball_is_past_the_line(x: float, y: float, goal: bool, own_goal: bool) -> None:
    events = begun_task().judge(x, y, False)
    assert (events.goal, events.own_goal, events.terminated) == (goal, own_goal, goal or own_goal)
    assert not events.truncated


def contacts(pattern: str, gap_steps: int) -> str:
    """The steps of a pattern of contact ("#") and none (".") in which a collision begins, as "#"."""
    task = begun_task(collision_gap_s=gap_steps * DEFAULTS.dt_s)
    events = [task.judge(0.0, 0.0, step == "#") for step in pattern]
    assert [event.collision for event in events] == [step == "#" for step in pattern]
    return "".join("#" if event.collision_begun else "." for event in events)


@pytest.mark.parametrize(
    ("pattern", "begun"),
    [
        ("..####..", "..#....."),
        ("#.##..##", "#......."),
        ("#...####", "#...#..."),
        ("#..#...#", "#......#"),
    ],
)
def test_a_collision_begins_once_and_a_short_gap_does_not_end_it(pattern: str, begun: str) -> None:
    assert contacts(pattern, gap_steps=3) == begun


def test_without_a_gap_every_new_contact_is_a_collision() -> None:
    assert contacts("##.#..#", gap_steps=1) == "#..#..#"


def test_time_limit_truncates_and_does_not_terminate() -> None:
    task = begun_task(max_steps=3)
    ends = [task.judge(0.0, 0.0, False) for _ in range(3)]
    assert [(end.terminated, end.truncated) for end in ends] == [(False, False), (False, False), (False, True)]


def test_a_goal_in_the_last_step_terminates_and_does_not_truncate() -> None:
    task = begun_task(max_steps=1)
    assert task.judge(PAST_LINE, 0.0, False) == Events(True, False, False, False, True, False)


def test_a_new_episode_forgets_steps_and_contacts() -> None:
    task = begun_task(max_steps=2)
    task.judge(0.0, 0.0, True)
    task.begin(2)
    assert task.judge(0.0, 0.0, True) == Events(False, False, True, True, False, False)
