"""What behaviors practise: rewards, ends and costs with numbers computed by hand."""

from __future__ import annotations

from math import cos, hypot, pi, sin, sqrt
from typing import Any

import pytest
from fbql_behaviors.core.exercises import (
    CONTACT_STEPS,
    EXERCISES,
    FACING_STEPS,
    FULL_SPEED_M_S,
    OWN_GOAL_STEPS,
    TAKE_OVER_M,
    TOUCH_M,
    WANDER_RAD_S,
    Attempt,
    approaching_reward,
    ball_seeking_reward,
    blind_driver,
    contact_per_1000_steps,
    drive,
    exercise_of,
    mean_cost,
    reaches_ball,
    stands_behind_ball,
    steps_to_arrive,
    wall_avoiding_reward,
    way_behind_ball,
)
from fbql_behaviors.core.observation import OBSERVATIONS
from fbql_behaviors.core.tree import Leaf, Tree
from fbql_common.core.errors import BadInput
from fbql_common.core.geometry import DETOUR_RADIUS_M
from fbql_common.core.types import World
from hypothesis import given
from hypothesis import strategies as st

DT_S = 1 / 60
FULL_STEP_M = FULL_SPEED_M_S * DT_S
"""What full speed covers in a step: 88 rad/s * 0.02 m / 60 = 0.029333 m."""
STOP = Tree("ball_seeking", OBSERVATIONS["ball_seeking"].features, (0,), (Leaf(0.0, 0.0, 1),))


def world(**fields: Any) -> World:
    """The robot in the middle of the field, looking at a ball half a metre ahead, far from the walls."""
    plain = World(0, 0, 0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0, 0.0, 0.9, -pi / 2, *[False] * 6)
    return plain._replace(**fields)


def test_driving_at_the_ball_at_full_speed_loses_nothing_and_standing_still_loses_the_step() -> None:
    assert ball_seeking_reward(world(), world(robot_x_m=FULL_STEP_M), DT_S) == pytest.approx(0.0)
    assert ball_seeking_reward(world(), world(), DT_S) == -1.0
    assert ball_seeking_reward(world(), world(robot_x_m=-FULL_STEP_M / 2), DT_S) == pytest.approx(-1.5)


def test_turning_towards_the_ball_is_progress() -> None:
    assert ball_seeking_reward(world(robot_yaw_rad=0.5), world(robot_yaw_rad=0.4), DT_S) == pytest.approx(
        0.1 * FACING_STEPS - 1.0
    )


def test_the_ball_is_reached_where_the_robots_corner_would_touch_it() -> None:
    assert pytest.approx(0.0743830) == TOUCH_M  # 0.0375 * sqrt 2 + 0.02135
    assert reaches_ball(world(ball_x_m=TOUCH_M))
    assert not reaches_ball(world(ball_x_m=TOUCH_M + 1e-6))


def test_wandering_far_from_walls_is_worth_the_way() -> None:
    assert wall_avoiding_reward(world(), world(robot_x_m=FULL_STEP_M), DT_S) == pytest.approx(1.0)
    assert wall_avoiding_reward(world(), world(), DT_S) == 0.0


def test_near_a_wall_the_way_off_it_counts_twice_and_the_way_towards_it_not_at_all() -> None:
    near, nearer = world(robot_y_m=0.80), world(robot_y_m=0.80 + FULL_STEP_M)
    assert wall_avoiding_reward(nearer, near, DT_S) == pytest.approx(2.0)
    assert wall_avoiding_reward(near, nearer, DT_S) == pytest.approx(0.0)


def test_beyond_20_centimetres_no_distance_from_a_wall_is_gained_or_lost() -> None:
    """Two steps of 1 cm away from a wall at y = 0.9 m; the nearer part of the second counts."""
    inside, edge, outside = world(robot_y_m=0.705), world(robot_y_m=0.695), world(robot_y_m=0.685)
    assert wall_avoiding_reward(inside, edge, DT_S) == pytest.approx(0.015 / FULL_STEP_M)
    assert wall_avoiding_reward(edge, outside, DT_S) == pytest.approx(0.010 / FULL_STEP_M)
    assert wall_avoiding_reward(outside, edge, DT_S) == pytest.approx(0.010 / FULL_STEP_M)
    assert wall_avoiding_reward(edge, inside, DT_S) == pytest.approx(0.005 / FULL_STEP_M)


def test_the_prices_of_an_exercise_are_these() -> None:
    """Every tuned tree depends on them: a change of one belongs into the changelog."""
    assert (FACING_STEPS, CONTACT_STEPS, OWN_GOAL_STEPS) == (12.0, 10.0, 300.0)
    assert (TAKE_OVER_M, WANDER_RAD_S) == (0.1, 60.0)
    assert pytest.approx(88.0 * 0.02) == FULL_SPEED_M_S


def test_each_step_in_contact_costs_the_same() -> None:
    assert wall_avoiding_reward(world(), world(collision=True), DT_S) == -CONTACT_STEPS
    assert wall_avoiding_reward(world(), world(collision=True, collision_begun=True), DT_S) == -CONTACT_STEPS


def test_the_blind_driver_drives_straight_on_until_a_wall_is_near() -> None:
    assert blind_driver(world(robot_y_m=0.9 - TAKE_OVER_M - 1e-6)) == (WANDER_RAD_S, WANDER_RAD_S)
    assert blind_driver(world(robot_y_m=0.9 - TAKE_OVER_M + 1e-6)) is None


@pytest.mark.parametrize(
    ("distance_m", "psi_rad", "way_m"),
    [
        (0.5, 0.0, 0.41),  # straight on: 0.5 - 0.09
        (0.18, pi / 3, 0.09 * sqrt(3)),  # acos(0.09 / 0.18) = pi/3: the tangent itself, sqrt(0.18^2 - 0.09^2)
        (0.18, pi / 3 + 1.0, 0.09 * sqrt(3) + 0.09),  # and a radian of arc
        (0.15, pi / 2, sqrt(0.15**2 - 0.09**2) + 0.09 * (pi / 2 - 0.927295218)),  # 0.12 m, acos 0.6
        (0.09, pi, 0.09 * pi),  # half round the ball
        (0.05, 1.0, 0.04 + 0.09),  # out of the circle, and a radian of arc
    ],
)
def test_the_way_behind_the_ball(distance_m: float, psi_rad: float, way_m: float) -> None:
    assert way_behind_ball(distance_m, psi_rad) == pytest.approx(way_m)
    assert way_behind_ball(distance_m, -psi_rad) == pytest.approx(way_m)


@given(st.floats(DETOUR_RADIUS_M, 2.0), st.floats(-pi, pi), st.floats(DETOUR_RADIUS_M, 2.0), st.floats(-pi, pi))
def test_no_way_gets_shorter_by_more_than_is_driven(d: float, psi: float, next_d: float, next_psi: float) -> None:
    # Two points outside of the circle: the straight line between them is no longer than any way driven.
    driven_m = hypot(d * cos(psi) - next_d * cos(next_psi), d * sin(psi) - next_d * sin(next_psi))
    assert abs(way_behind_ball(d, psi) - way_behind_ball(next_d, next_psi)) <= max(
        driven_m * (pi / 2), 1e-9
    )  # round the circle a way is at most pi/2 times as long as the straight line through it


def test_coming_nearer_to_the_place_behind_the_ball_is_progress() -> None:
    # Straight behind the ball (psi = 0, the goal at +x), the way is the distance less the radius.
    assert approaching_reward(world(), world(robot_x_m=FULL_STEP_M), DT_S) == pytest.approx(0.0)
    assert approaching_reward(world(), world(), DT_S) == -1.0


def test_an_own_goal_never_pays() -> None:
    assert approaching_reward(world(), world(own_goal=True), DT_S) == -1.0 - OWN_GOAL_STEPS
    assert exercise_of("approaching").max_steps * -1.0 < -OWN_GOAL_STEPS


@pytest.mark.parametrize(
    ("fields", "is_there"),
    [
        ({"ball_x_m": 0.14}, True),
        ({"ball_x_m": 0.16}, False),
        ({"ball_x_m": 0.14, "robot_yaw_rad": 0.31}, False),
        ({"ball_x_m": -0.14, "robot_yaw_rad": pi}, False),
        ({"ball_x_m": -0.14, "robot_yaw_rad": pi, "goal": True}, True),
    ],
)
def test_behind_the_ball_is_near_in_line_with_the_goal_and_facing_it(fields: dict[str, Any], is_there: bool) -> None:
    assert stands_behind_ball(world(**fields)) is is_there


def test_an_episode_that_does_not_arrive_costs_all_its_steps() -> None:
    cost = steps_to_arrive(600)
    assert cost(Attempt(70, True, 0, 0, 1.0)) == 70.0
    assert cost(Attempt(70, False, 0, 0, 1.0)) == 600.0


def test_contact_is_counted_per_1000_steps() -> None:
    assert contact_per_1000_steps(Attempt(500, False, 2, 13, 1.0)) == 26.0


def test_the_measure_is_the_mean_cost() -> None:
    episodes = [Attempt(70, True, 0, 0, 1.0), Attempt(30, False, 0, 0, 1.0)]
    assert mean_cost(episodes, exercise_of("ball_seeking")) == 335.0


def test_a_behavior_without_an_exercise_is_refused_with_those_that_have_one() -> None:
    with pytest.raises(BadInput, match=r"'juggling'.*approaching, ball_seeking, wall_avoiding"):
        exercise_of("juggling")


class Still:
    """An environment in which nothing moves; the ball is touched by itself after some steps."""

    def __init__(self, steps: int) -> None:
        self._steps = steps
        self.commands: list[tuple[float, float]] = []

    def reset(self, seed: int) -> World:
        self.commands.clear()
        return world()

    def step(self, left_rad_s: float, right_rad_s: float) -> World:
        self.commands.append((left_rad_s, right_rad_s))
        step = len(self.commands)
        return world(
            step=step, ball_x_m=0.05 if step == self._steps else 0.5, collision=step > 2, collision_begun=step == 3
        )


def test_an_episode_ends_where_it_arrives() -> None:
    environment = Still(steps=4)
    assert drive(STOP, exercise_of("ball_seeking"), environment, 0) == Attempt(4, True, 1, 2, 0.0)
    assert environment.commands == [(0.0, 0.0)] * 4


def test_an_episode_that_does_not_arrive_is_truncated() -> None:
    assert drive(STOP, exercise_of("ball_seeking"), Still(steps=9999), 0).steps == 600


def test_an_attempt_takes_at_most_the_steps_of_its_exercise() -> None:
    assert {name: exercise.max_steps for name, exercise in EXERCISES.items()} == {
        "ball_seeking": 600,
        "wall_avoiding": 1000,
        "approaching": 600,
    }
