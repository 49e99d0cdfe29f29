"""Each source does the one thing that it is for, and mirrors itself."""

from __future__ import annotations

from math import pi, radians

import numpy as np
import pytest
from fbql_studies.rooms.maps import rectangle, room_of
from fbql_studies.rooms.play import alone, outcome_of
from fbql_studies.rooms.robot import ANGLES, BEAMS, RANGE_M, SPACE, Ranges, reading_of
from fbql_studies.rooms.sources import (
    SECTORS_DEG,
    SOURCES,
    WALL_M,
    back_up,
    follow_gap,
    follow_wall_left,
    follow_wall_right,
    go_to_goal,
    observe,
    way_to_goal,
)
from fbql_studies.rooms.worlds import TwinWorld

OPEN = np.full(BEAMS, RANGE_M)


def blocked(from_deg: float, to_deg: float, at_m: float = 0.5) -> Ranges:
    """A scan with something in one sector."""
    ranges = OPEN.copy()
    degrees = np.degrees(ANGLES)
    ranges[(degrees >= from_deg - 1e-6) & (degrees <= to_deg + 1e-6)] = at_m
    return ranges


def mirrored(ranges: Ranges) -> Ranges:
    return np.roll(ranges[::-1], 1)


@pytest.mark.parametrize("name", SOURCES)
def test_every_command_is_one_that_the_robot_takes(name: str) -> None:
    generator = np.random.default_rng(1)
    for _ in range(200):
        ranges = generator.uniform(0.0, RANGE_M, BEAMS)
        command = SOURCES[name](ranges, float(generator.uniform(0.0, 9.0)), float(generator.uniform(-pi, pi)))
        assert command == SPACE.limited(command)


def test_a_mirrored_situation_has_the_mirrored_command() -> None:
    twins = {name: name for name in SOURCES} | {"wall_left": "wall_right", "wall_right": "wall_left"}
    generator = np.random.default_rng(2)
    for seed in range(60):
        ranges = TwinWorld().reset(room_of("traps", seed)).ranges - generator.uniform(0.0, 1e-6, BEAMS)
        distance, bearing = float(generator.uniform(0.0, 9.0)), float(generator.uniform(-3.0, 3.0))
        for name, twin in twins.items():
            v, w = SOURCES[name](ranges, distance, bearing)
            other_v, other_w = SOURCES[twin](mirrored(ranges), distance, -bearing)
            assert (other_v, other_w) == pytest.approx((v, -w))


def test_go_to_goal_turns_first_and_sees_nothing() -> None:
    assert go_to_goal(OPEN, 5.0, pi / 2) == (pytest.approx(0.0), 1.5)
    assert go_to_goal(OPEN, 5.0, 0.0) == go_to_goal(blocked(-90, 90, 0.25), 5.0, 0.0) == (0.8, 0.0)


def test_the_gap_follower_heads_for_the_widest_gap_and_turns_on_the_spot_where_there_is_none() -> None:
    v, w = follow_gap(blocked(-90, 30), 5.0, 0.0)
    assert w == pytest.approx(min(2.0 * radians(62.5), 1.5))
    assert v > 0.0 or blocked(-90, 30).min() <= 0.5
    assert follow_gap(OPEN, 5.0, 2.0) == (0.8, 0.0)
    v, w = follow_gap(blocked(-90, 90, 0.9), 5.0, 0.0)
    assert v == 0.0
    assert abs(w) > 1.0


@pytest.mark.parametrize(("source", "side"), [(follow_wall_left, 1), (follow_wall_right, -1)])
def test_a_wall_follower_comes_to_its_distance_from_the_wall(source: object, side: int) -> None:
    room = room_of("traps", 0)._replace(
        obstacles=(rectangle(5.0, 5.0 + side * 1.1, 30.0, 0.2, 0.0),), start=(0.0, 5.0, 0.0), goal=(20.0, 5.0)
    )
    world = TwinWorld()
    reading = world.reset(room)
    for _ in range(100):
        assert not reading.collided
        reading = world.step(*SPACE.limited(source(reading.ranges, 1.0, 0.0)))  # type: ignore[operator]
    assert abs(5.0 + side * 1.0 - reading.y_m) == pytest.approx(WALL_M, abs=0.1)
    assert reading.x_m > 3.0


def test_back_up_drives_back_only_while_there_is_room_and_turns_to_the_freer_side() -> None:
    assert back_up(blocked(10, 90), 5.0, 0.0) == (pytest.approx(-0.3), -0.6)
    assert back_up(np.minimum(blocked(-90, -10), blocked(145, 179, 0.3)), 5.0, 0.0) == (0.0, 0.6)


@pytest.mark.parametrize("name", ["gap", "wall_left", "wall_right", "back"])
def test_what_sees_obstacles_does_not_run_into_them(name: str) -> None:
    rooms = [room_of("traps", seed) for seed in range(8)]
    assert all(end.outcome != "collision" for end in alone(SOURCES[name], TwinWorld(), rooms))


def test_the_mux_senses_the_goal_and_five_sectors() -> None:
    for index, (right, left) in enumerate(SECTORS_DEG):
        ranges = blocked(right, left, 0.7)
        goal, *sectors = observe(reading_of(0, (1.0, 1.0, pi / 2), ranges, (1.0, 4.0), False))
        assert goal == pytest.approx((3.0, 0.0))
        assert sectors == [(0.7 if k == index else RANGE_M,) for k in range(5)]


def test_the_way_to_the_goal_is_blocked_by_what_stands_before_it_only() -> None:
    behind_us = np.minimum(blocked(-180, -160, 0.6), blocked(160, 175, 0.8))
    assert way_to_goal(behind_us, 5.0, 0.0) == RANGE_M
    assert way_to_goal(behind_us, 5.0, pi - 1e-9) == way_to_goal(behind_us, 5.0, -pi) == 0.6
    assert way_to_goal(behind_us, 0.5, pi - 1e-9) == RANGE_M


def test_an_outcome_is_a_success_a_collision_or_a_timeout() -> None:
    at_goal = reading_of(5, (1.0, 1.0, 0.0), OPEN, (1.2, 1.0), False)
    assert [outcome_of(each) for each in (at_goal, at_goal._replace(collided=True))] == ["success", "collision"]
    assert outcome_of(at_goal._replace(goal_distance_m=1.0)) == ""
    assert outcome_of(at_goal._replace(goal_distance_m=1.0, step=400)) == "timeout"
