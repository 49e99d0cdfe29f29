"""What the behaviors sense."""

from __future__ import annotations

import math
from math import pi

import pytest
from fbql_behaviors.core.observation import (
    DETOUR_RADIUS_M,
    OBSERVATIONS,
    Feature,
    Observation,
    approaching,
    observation_of,
    register,
)
from fbql_common.core.errors import BadInput
from fbql_common.core.geometry import approach_angle
from fbql_common.core.types import World
from hypothesis import given
from hypothesis import strategies as st


def world_with(
    robot: tuple[float, float, float] = (0.0, 0.0, 0.0),
    ball: tuple[float, float] = (0.5, 0.0),
    wall: tuple[float, float] = (0.0, 0.9),
) -> World:
    return World(1, 0, 0, *robot, 0.0, 0.0, *ball, 0.0, 0.0, *wall, 0.0, *[False] * 6)


def beside_the_side_wall(robot: tuple[float, float, float], ball: tuple[float, float]) -> World:
    return world_with(robot, ball, (robot[0], math.copysign(0.9, robot[1])))


ball_seeking, wall_avoiding = OBSERVATIONS["ball_seeking"].sense, OBSERVATIONS["wall_avoiding"].sense
X, Y = st.floats(-1.1, 1.1), st.floats(-0.9, 0.9)
WORLDS = st.builds(beside_the_side_wall, st.tuples(X, Y, st.floats(-pi, pi)), st.tuples(X, Y))


def test_ball_seeking_senses_distance_and_bearing_of_the_ball() -> None:
    assert ball_seeking(world_with((0.1, 0.2, pi / 2), (0.1, 0.7))) == pytest.approx((0.5, 0.0))
    assert ball_seeking(world_with((0.0, 0.0, 0.0), (0.0, -0.4))) == pytest.approx((0.4, -pi / 2))


def test_wall_avoiding_senses_distance_and_bearing_of_the_closest_wall_point() -> None:
    assert wall_avoiding(world_with((0.2, 0.6, 0.0), wall=(0.2, 0.9))) == pytest.approx((0.3, pi / 2))


@given(WORLDS)
def test_every_place_on_the_field_lies_inside_the_root_region(world: World) -> None:
    for observation in OBSERVATIONS.values():
        for value, feature in zip(observation.sense(world), observation.features, strict=True):
            assert feature.low <= value < feature.high, feature.name


def test_a_bearing_straight_behind_is_minus_pi() -> None:
    assert ball_seeking(world_with((0.0, 0.0, 0.0), (-0.5, 0.0)))[1] == -pi


def test_behind_the_ball_and_in_line_with_the_goal_the_detour_is_the_line_to_the_ball() -> None:
    error, psi = approaching(world_with((-0.5, 0.0, 0.3), (0.0, 0.0)))
    assert (error, psi) == pytest.approx((-0.3, 0.0))


def test_beside_the_ball_the_detour_leads_behind_it() -> None:
    # the ball is to the right of the robot, the goal ahead: psi = +90 degrees, so it must pass the ball on the -x side
    world = world_with((0.0, 0.5, -pi / 2), (0.0, 0.0))
    error, psi = approaching(world)
    heading = world.robot_yaw_rad + error
    assert psi == pytest.approx(pi / 2)
    assert math.cos(heading) < 0.0
    # it is the tangent to the circle round the ball
    assert 0.5 * math.sin(abs(error)) == pytest.approx(DETOUR_RADIUS_M)


def test_inside_of_the_detour_circle_the_robot_is_led_out_of_it() -> None:
    error, _ = approaching(world_with((0.07, 0.0, pi), (0.0, 0.0)))
    assert abs(error) > pi / 2


@given(WORLDS)
def test_the_observations_are_mirrored_when_the_world_is(world: World) -> None:
    mirrored = world_with(
        (world.robot_x_m, -world.robot_y_m, -world.robot_yaw_rad),
        (world.ball_x_m, -world.ball_y_m),
        (world.wall_x_m, -world.wall_y_m),
    )
    for observation in OBSERVATIONS.values():
        here, there = observation.sense(world), observation.sense(mirrored)
        for feature, value, other in zip(observation.features, here, there, strict=True):
            expected = value if feature.unit == "m" else -value
            assert abs(math.remainder(other - expected, 2 * pi)) < 1e-6 or is_at_the_seam(world)


def is_at_the_seam(world: World) -> bool:
    """Straight in front of the ball, where the detour may lead either way."""
    return abs(abs(approach_angle(world)) - pi) < 1e-6 or ball_seeking(world)[0] < 1e-6


def test_an_unknown_behavior_is_refused_with_the_known_names() -> None:
    with pytest.raises(BadInput, match="unknown behavior 'dance'; known are: approaching, ball_seeking"):
        observation_of("dance")


def test_a_new_behavior_registers_its_observation_and_replaces_its_own_but_none_that_ships() -> None:
    goal_distance = Observation((Feature("goal_distance", "m", 0.0, 3.2),), lambda world: (1.1 - world.robot_x_m,))
    try:
        register("test_goal", goal_distance)
        assert observation_of("test_goal").sense(world_with()) == (1.1,)
        register("test_goal", OBSERVATIONS["ball_seeking"])
        assert observation_of("test_goal") is OBSERVATIONS["ball_seeking"], "as a notebook's cell that is run again"
        register("ball_seeking", OBSERVATIONS["ball_seeking"])
        with pytest.raises(BadInput, match="behavior 'ball_seeking': this package has an observation of that name"):
            register("ball_seeking", goal_distance)
    finally:
        OBSERVATIONS.pop("test_goal", None)
