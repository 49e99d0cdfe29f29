"""A robot that sees all scores: the simulator is playable, and not trivially so."""

from __future__ import annotations

from math import asin, atan2, cos, hypot, pi
from statistics import mean

import pytest
from fbql_common.core.types import World
from fbql_sim.core.scripted_law import TUNED, UNTUNED, LawConstants, law, push_direction, wheels_towards
from fbql_sim.core.world_loop import WorldLoop

EPISODES = 50


def test_a_scripted_law_without_trees_scores_in_about_300_steps() -> None:
    loop = WorldLoop()
    ends = list[World]()
    for episode in range(EPISODES):
        world = loop.reset(episode, seed=episode)
        while not world.ended:
            world = loop.step(*law(world))
        ends.append(world)
    assert len(ends) == EPISODES
    assert sum(world.goal for world in ends) >= EPISODES - 1
    assert 250 <= mean(world.step for world in ends) <= 500
    assert len({world.step for world in ends}) > EPISODES / 2, "the episodes are hardly different"


def test_a_robot_at_rest_never_scores() -> None:
    loop = WorldLoop()
    world = loop.reset(0, seed=0)
    while not world.ended:
        world = loop.step(0.0, 0.0)
    assert world.truncated
    assert not world.terminated


@pytest.mark.parametrize(
    ("constants", "expected"),
    [
        (UNTUNED, [599, 235, 317, 416, 441, 382, 229, 314, 259, 238, 614, 183]),
        (TUNED, [121, 125, 132, 138, 129, 133, 123, 127, 130, 123, 135, 125]),
    ],
)
def test_the_law_plays_as_when_the_figures_in_the_documents_were_measured(
    constants: LawConstants, expected: list[int]
) -> None:
    loop = WorldLoop()
    steps: list[int] = []
    for episode in range(12):
        world = loop.reset(episode, seed=episode)
        while not world.ended:
            world = loop.step(*law(world, constants))
        steps.append(world.step)
    assert steps == expected


def test_the_tuned_law_takes_less_than_half_the_steps_of_the_one_set_by_hand() -> None:
    loop = WorldLoop()
    steps: dict[LawConstants, int] = {UNTUNED: 0, TUNED: 0}
    for constants in steps:
        for episode in range(20):
            world = loop.reset(episode, seed=episode)
            while not world.ended:
                world = loop.step(*law(world, constants))
            assert world.goal
            steps[constants] += world.step
    assert steps[TUNED] < 0.5 * steps[UNTUNED]


def still(ball: tuple[float, float], robot: tuple[float, float] = (0.0, 0.3), **changes: float) -> World:
    """A robot that looks along the field, a ball at rest, the walls far away."""
    world = World(
        0, 0, 0, *robot, 0.0, 0.0, 0.0, *ball, 0.0, 0.0, robot[0], robot[1] + 0.5, -pi / 2,
        False, False, False, False, False, False,
    )  # fmt: skip
    return world._replace(**changes)


PUSH = atan2(-0.27, 1.04), atan2(-0.27, 1.0), atan2(-0.27, 0.97)
"""Directions to the goal from (0.08, 0.3), (0.12, 0.3) and (0.15, 0.3)."""


@pytest.mark.parametrize(
    ("world", "heading_rad", "speed_m_s"),
    [
        (still((0.08, 0.3)), -PUSH[0], 0.8),  # at most 8 cm away it aims beside the ball by psi, farther by 1.4 psi
        (still((0.12, 0.3)), -1.4 * PUSH[1], 0.8),
        (still((0.15, 0.3)), -1.4 * PUSH[2], 1.0),  # from 15 cm on at full speed
        (still((1.05, 0.3), (1.05, 0.42)), pi / 2 - pi, 0.8),  # along the end wall, slowly only within 12 cm
        (still((1.05, 0.3), (1.05, 0.41)), pi / 2 - pi, 0.25),
        (still((0.0, 0.0), (0.5, 0.0)), pi - asin(0.085 / 0.5), 1.0),  # round a ball that it is in front of
        (still((0.0, 0.0), (0.085, 0.0)), pi - (pi - 1.0), 1.0),  # inside of the detour's circle
        (still((0.0, 0.0), (0.05, 0.0)), pi - (pi - 0.05 / 0.085), 1.0),
        (still((0.3, 0.0), (0.0, 0.0), ball_vx_m_s=1.0), 0.0, 1.0),
        # off the wall: 5 cm beside it, the way to the ball leads into it
        (still((0.3, 0.88), (0.0, 0.85), wall_x_m=0.0, wall_y_m=0.90), -0.2, 1.0),
    ],
)
def test_the_way_to_the_ball_is_the_one_by_hand(world: World, heading_rad: float, speed_m_s: float) -> None:
    assert law(world) == pytest.approx(wheels_towards(heading_rad, speed_m_s), abs=1e-9)


@pytest.mark.parametrize(
    ("error_rad", "forward_m_s", "turn_rad_s"),
    [
        (0.0, 1.0, 0.0),
        (0.5, cos(0.5) ** 2, 6.0),  # 12 1/s times the error
        (-0.5, cos(0.5) ** 2, -6.0),
        (1.5, cos(1.5) ** 2, 15.0),  # at most 15 rad/s
        (-1.5, cos(1.5) ** 2, -15.0),
        (pi - 0.5, -(cos(0.5) ** 2), -6.0),  # backwards, which is the smaller turn
        (0.5 - pi, -(cos(0.5) ** 2), 6.0),
        (pi, -1.0, 0.0),
        (pi / 2, 0.0, 15.0),  # neither turn is the smaller one
    ],
)
def test_the_wheels_turn_towards_a_heading_and_drive_backwards_where_that_is_the_smaller_turn(
    error_rad: float, forward_m_s: float, turn_rad_s: float
) -> None:
    left, right = wheels_towards(error_rad, 1.0)
    assert (left + right) / 2 * 0.02 == pytest.approx(forward_m_s, abs=1e-12)  # wheels of 2 cm radius
    assert (right - left) * 0.02 / 0.07 == pytest.approx(turn_rad_s, abs=1e-12)  # 7 cm apart


@pytest.mark.parametrize(
    ("ball", "direction_rad"),
    [
        ((0.0, 0.0), 0.0),
        ((0.5, 0.4), atan2(-0.36, 0.62)),
        ((0.5, -0.4), atan2(0.36, 0.62)),
        ((0.0, 0.85), 0.0),  # along the side wall
        ((0.0, -0.85), 0.0),
        ((0.98, 0.85), -pi / 4),  # round the corner
        ((0.98, -0.85), pi / 4),
        ((1.03, 0.5), -pi / 2),  # along the end wall
        ((1.03, -0.5), pi / 2),
        ((1.03, 0.1), atan2(-0.09, 0.09)),  # in front of the goal
        ((1.02, 0.5), atan2(-0.45, 0.10)),  # walls are near beyond these places, not at them
        ((1.03, 0.16), atan2(-0.144, 0.09)),
        ((0.0, 0.84), atan2(-0.756, 1.12)),
        ((0.97, 0.85), 0.0),
    ],
)
def test_the_ball_is_pushed_towards_the_goal_and_along_walls(ball: tuple[float, float], direction_rad: float) -> None:
    assert push_direction(*ball) == pytest.approx(direction_rad)


OTHER = LawConstants(
    speed_m_s=0.5, push_speed_m_s=0.4, wall_push_speed_m_s=0.1, push_within_m=0.3, wall_push_within_m=0.2, most_ahead_s=0.1,
    cone_rad=0.3, aim_gain=2.0, near_aim_gain=3.0, near_aim_within_m=0.04, clearance_m=0.1, off_wall_within_m=0.1,
    off_wall_rad=0.4, turn_gain_1_s=6.0, most_turn_rad_s=5.0, slowing_power=1.0,
)  # fmt: skip


@pytest.mark.parametrize(
    ("world", "heading_rad", "speed_m_s"),
    [
        (still((0.5, 0.2), robot=(0.3, 0.2)), -2.0 * atan2(-0.18, 0.62), 0.4),  # 20 cm away, within 30 cm
        (still((0.5, 0.2), robot=(0.47, 0.2)), -3.0 * atan2(-0.18, 0.62), 0.4),  # 3 cm away, within 4 cm
        (still((0.5, 0.3), robot=(0.1, 0.3)), asin(0.1 / 0.4), 0.5),  # beyond the narrower cone it goes round
        (still((1.05, 0.3), robot=(1.05, 0.45)), pi / 2 - pi, 0.1),  # along the end wall within 20 cm
        (still((0.3, 0.0), robot=(0.0, 0.0), ball_vx_m_s=1.0), 0.0, 0.5),
        (still((0.3, 0.88), robot=(0.0, 0.81), wall_x_m=0.0, wall_y_m=0.90), -0.4, 0.5),  # 9 cm beside a wall
    ],
)
def test_every_constant_of_the_law_is_in_force(world: World, heading_rad: float, speed_m_s: float) -> None:
    assert law(world, OTHER) == pytest.approx(wheels_towards(heading_rad, speed_m_s, OTHER), abs=1e-9)


def test_the_ball_is_met_where_it_will_be_after_the_time_that_is_allowed() -> None:
    world = still((0.5, 0.0), robot=(0.0, 0.0), ball_vy_m_s=1.0)  # 0.1 s ahead, not the 1 s to get there
    to_ball = atan2(0.1, 0.5)
    psi = atan2(-0.09, 0.62) - to_ball
    assert abs(psi) > OTHER.cone_rad
    beside = asin(0.1 / hypot(0.5, 0.1))
    assert law(world, OTHER) == pytest.approx(wheels_towards(to_ball + min(-psi, beside), 0.5, OTHER), abs=1e-9)


def test_steering_has_the_gain_the_limit_and_the_slowing_that_are_given() -> None:
    for error_rad, forward_m_s, turn_rad_s in ((0.5, cos(0.5), 3.0), (1.2, cos(1.2), 5.0)):
        left, right = wheels_towards(error_rad, 1.0, OTHER)
        assert (left + right) / 2 * 0.02 == pytest.approx(forward_m_s, abs=1e-12)
        assert (right - left) * 0.02 / 0.07 == pytest.approx(turn_rad_s, abs=1e-12)
