"""Eq. 27: bodies that overlap are moved apart, others stay where they are."""

from __future__ import annotations

from math import cos, hypot, pi, sin

import pytest
from fbql_common.core.field import BALL_RADIUS_M, ROBOT_SIDE_M
from fbql_common.core.walls import HALF_GOAL, HALF_LENGTH, HALF_WIDTH, POCKET, SIDE_END, closest_wall
from fbql_fusion.core.tasks.soccer.world_model.bodies import ball_off_robot, ball_off_walls, robot_off_walls, room
from hypothesis import given
from hypothesis import strategies as st

HALF = ROBOT_SIDE_M / 2


def overlap_of_ball_and_square(x: float, y: float) -> float:
    dx, dy = abs(x) - HALF, abs(y) - HALF
    if max(dx, dy) <= 0.0:
        return BALL_RADIUS_M - max(dx, dy)
    return BALL_RADIUS_M - hypot(max(dx, 0.0), max(dy, 0.0))


@given(st.floats(-0.1, 0.1), st.floats(-0.1, 0.1))
def test_a_ball_that_overlaps_the_robot_ends_in_touch_with_it_and_another_one_stays(x: float, y: float) -> None:
    moved = ball_off_robot(x, y)
    if overlap_of_ball_and_square(x, y) <= 0.0:
        assert moved == (x, y)
    else:
        assert overlap_of_ball_and_square(*moved) == pytest.approx(0.0, abs=1e-9)


def test_a_ball_before_the_robot_is_moved_straight_ahead() -> None:
    assert ball_off_robot(0.05, 0.01) == pytest.approx((HALF + BALL_RADIUS_M, 0.01))
    assert ball_off_robot(-0.02, 0.01) == pytest.approx((-HALF - BALL_RADIUS_M, 0.01))
    assert ball_off_robot(0.01, -0.02) == pytest.approx((0.01, -HALF - BALL_RADIUS_M))
    assert ball_off_robot(0.01, 0.02) == pytest.approx((0.01, HALF + BALL_RADIUS_M))


def test_a_ball_that_is_as_near_to_two_sides_leaves_ahead_or_behind() -> None:
    assert ball_off_robot(0.0, 0.0) == pytest.approx((HALF + BALL_RADIUS_M, 0.0))
    assert ball_off_robot(-0.02, 0.02) == pytest.approx((-HALF - BALL_RADIUS_M, 0.02))


@given(st.floats(-POCKET, POCKET), st.floats(-HALF_WIDTH, HALF_WIDTH))
def test_a_ball_ends_a_radius_from_the_closest_wall_or_stays(x: float, y: float) -> None:
    wall_x, wall_y, normal_x, normal_y, _ = closest_wall(x, y)
    away = (x - wall_x) * normal_x + (y - wall_y) * normal_y
    moved = ball_off_walls(x, y)
    if away >= BALL_RADIUS_M:
        assert moved == (x, y)
    else:
        wall_x, wall_y, normal_x, normal_y, _ = closest_wall(*moved)
        assert (moved[0] - wall_x) * normal_x + (moved[1] - wall_y) * normal_y > BALL_RADIUS_M - 0.01


def test_in_a_right_angle_both_walls_move_the_ball() -> None:
    assert ball_off_walls(POCKET - 0.01, HALF_GOAL - 0.01) == pytest.approx(
        (POCKET - BALL_RADIUS_M, HALF_GOAL - BALL_RADIUS_M)
    )


@pytest.mark.parametrize("yaw", [0.0, 0.3, pi / 4, 2.0, -3.0])
def test_no_corner_of_the_robot_stays_in_a_flat_wall(yaw: float) -> None:
    x, y = robot_off_walls(0.2, HALF_WIDTH - 0.01, cos(yaw), sin(yaw))
    corners = [y + sin(yaw) * a + cos(yaw) * b for a in (-HALF, HALF) for b in (-HALF, HALF)]
    assert x == 0.2
    assert max(corners) == pytest.approx(HALF_WIDTH)


def test_a_robot_away_from_walls_stays() -> None:
    assert robot_off_walls(0.2, 0.3, 1.0, 0.0) == (0.2, 0.3)


def test_at_a_goal_post_the_robots_side_counts_and_not_its_corner() -> None:
    x, y = robot_off_walls(HALF_LENGTH - 0.03, HALF_GOAL - 0.001, 1.0, 0.0)
    assert hypot(HALF_LENGTH - x, HALF_GOAL - y) == pytest.approx(HALF, rel=0.01)


def test_a_ball_in_the_corner_triangle_is_moved_along_the_diagonal() -> None:
    x, y = ball_off_walls(SIDE_END + 0.035, HALF_WIDTH - 0.035)
    assert (x, y) == pytest.approx(
        (SIDE_END + 0.035 - BALL_RADIUS_M / 2**0.5, HALF_WIDTH - 0.035 - BALL_RADIUS_M / 2**0.5)
    )


@given(st.floats(-POCKET, POCKET), st.floats(-HALF_WIDTH, HALF_WIDTH))
def test_no_wall_is_nearer_than_the_room(x: float, y: float) -> None:
    wall_x, wall_y, normal_x, normal_y, _ = closest_wall(x, y)
    assert room(x, y) <= (x - wall_x) * normal_x + (y - wall_y) * normal_y + 1e-12
