"""A robot that sees all scores: the simulator is playable, and not trivially so."""

from __future__ import annotations

from math import atan2, cos, pi
from statistics import mean

import pytest
from fbql_common.core.types import World
from fbql_sim.core.scripted_law import law, push_direction, wheels_towards
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
    ],
)
def test_the_ball_is_pushed_towards_the_goal_and_along_walls(ball: tuple[float, float], direction_rad: float) -> None:
    assert push_direction(*ball) == pytest.approx(direction_rad)
