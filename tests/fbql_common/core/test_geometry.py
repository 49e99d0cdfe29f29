"""Directions and distances, against points that were placed with complex numbers."""

from __future__ import annotations

from cmath import phase, rect
from math import pi, tau

import pytest
from fbql_common.core.field import FIELD
from fbql_common.core.geometry import (
    approach_angle,
    ball_distance_and_bearing,
    distance_and_bearing,
    wall_distance_and_bearing,
    wrap_angle,
    wrap_bearing,
)
from fbql_common.core.types import World
from hypothesis import given
from hypothesis import strategies as st

COORDINATES = st.floats(-1.1, 1.1)
ANGLES = st.floats(-3.1, 3.1)
DISTANCES = st.floats(0.01, 3.0)
NOWHERE = World(0, 0, 0, *(0.0,) * 12, *(False,) * 6)


@pytest.mark.parametrize("turns", [-3, -1, 0, 1, 2])
@pytest.mark.parametrize("angle", [-3.0, -0.5, 0.0, 1.5, 3.0])
def test_whole_turns_do_not_change_a_direction(angle: float, turns: int) -> None:
    assert wrap_angle(angle + turns * tau) == pytest.approx(angle)
    assert wrap_bearing(angle + turns * tau) == pytest.approx(angle)


def test_a_heading_backwards_is_pi_and_a_bearing_backwards_is_minus_pi() -> None:
    assert [wrap_angle(angle) for angle in (pi, -pi)] == [pi, pi]
    assert [wrap_bearing(angle) for angle in (pi, -pi)] == [-pi, -pi]


@given(COORDINATES, COORDINATES, ANGLES, DISTANCES, ANGLES)
def test_a_point_is_where_its_distance_and_bearing_say(
    x_m: float, y_m: float, yaw_rad: float, distance_m: float, bearing_rad: float
) -> None:
    point = complex(x_m, y_m) + rect(distance_m, yaw_rad + bearing_rad)
    robot = NOWHERE._replace(robot_x_m=x_m, robot_y_m=y_m, robot_yaw_rad=yaw_rad)
    seen = [
        distance_and_bearing(robot, point.real, point.imag),
        ball_distance_and_bearing(robot._replace(ball_x_m=point.real, ball_y_m=point.imag)),
        wall_distance_and_bearing(robot._replace(wall_x_m=point.real, wall_y_m=point.imag)),
    ]
    for pair in seen:
        assert pair == pytest.approx((distance_m, bearing_rad), abs=1e-9)


def test_what_is_right_behind_is_at_minus_pi() -> None:
    """The root region of a bearing is [-pi, pi)."""
    behind = NOWHERE._replace(ball_x_m=-1.0, wall_x_m=-1.0)
    assert distance_and_bearing(behind, -1.0, 0.0) == (1.0, -pi)
    assert ball_distance_and_bearing(behind) == (1.0, -pi)
    assert wall_distance_and_bearing(behind) == (1.0, -pi)


@given(COORDINATES, COORDINATES, DISTANCES, ANGLES)
def test_the_approach_angle_is_between_the_line_to_the_ball_and_that_from_it_to_the_goal(
    ball_x_m: float, ball_y_m: float, distance_m: float, psi_rad: float
) -> None:
    ball, goal = complex(ball_x_m, ball_y_m), complex(FIELD.half_length_m, 0.0)
    if abs(goal - ball) < 0.01:
        return
    robot = ball - rect(distance_m, phase(goal - ball) - psi_rad)
    world = NOWHERE._replace(
        robot_x_m=robot.real, robot_y_m=robot.imag, ball_x_m=ball_x_m, ball_y_m=ball_y_m, robot_yaw_rad=1.0
    )
    assert approach_angle(world) == pytest.approx(psi_rad, abs=1e-9)


def test_a_robot_between_ball_and_goal_is_at_minus_pi() -> None:
    assert approach_angle(NOWHERE._replace(robot_x_m=0.5)) == -pi
    assert approach_angle(NOWHERE._replace(robot_x_m=-0.5)) == 0.0
