"""The kinematic bound: cases by hand, and play that never undercuts it."""

from __future__ import annotations

from math import ceil, hypot, sqrt

import numpy as np
import pytest
from fbql_common.core.field import MAX_WHEEL_RAD_S
from fbql_sim.core.kinematic_bound import REACH_M, TOP_SPEED_M_S, fastest_kick_m_s, least_steps
from fbql_sim.core.parameters import SimulationParameters
from fbql_sim.core.physics import Physics, Start
from fbql_sim.core.scripted_law import TUNED, law
from fbql_sim.core.task import GOAL_X_M, Task
from fbql_sim.core.world_loop import WorldLoop

DEFAULT = SimulationParameters()
ROUND = SimulationParameters(dt_s=0.05, wheel_acceleration_m_s2=8.0)
"""Steps in which the robot gains 0.4 m/s: it drives 2, 4, 6, 8 cm in the first ones, then 8.8 cm at full speed."""


def start(robot_x_m: float, ball: tuple[float, float], robot_y_m: float = 0.0, yaw_rad: float = 0.0) -> Start:
    return Start(robot_x_m, robot_y_m, yaw_rad, *ball)


@pytest.mark.parametrize(
    ("way_m", "steps"),
    [(0.0, 1), (0.02, 1), (0.021, 2), (0.06, 2), (0.12, 3), (0.20, 4), (0.201, 5), (0.288, 5), (0.29, 6)],
)
def test_the_robot_gains_speed_in_each_step_up_to_the_top_speed(way_m: float, steps: int) -> None:
    """The ball is fast enough to be past the line in the step in which it is touched."""
    placed = start(0.0, (way_m + REACH_M - 1e-6, 0.0))
    assert least_steps(placed, ROUND, ball_m_s=1e9) == steps


@pytest.mark.parametrize(("to_line_m", "steps"), [(0.04, 1), (0.049, 1), (0.051, 2), (0.099, 2), (0.101, 3), (1.0, 20)])
def test_the_ball_rolls_to_the_line_at_its_highest_speed(to_line_m: float, steps: int) -> None:
    """Robot and ball touch at the start, so that the ball has the whole first step: 5 cm of them at 1 m/s."""
    ball_x = GOAL_X_M - to_line_m
    placed = start(ball_x - REACH_M, (ball_x, 0.0))
    assert least_steps(placed, ROUND, ball_m_s=1.0) == steps


def test_the_step_in_which_they_meet_is_shared() -> None:
    """1 cm of 2 cm in the first step: half of it is left, in which the ball rolls 2.5 cm at 1 m/s."""
    for to_line_m, steps in ((0.024, 1), (0.026, 2), (0.074, 2), (0.076, 3)):
        ball_x = GOAL_X_M - to_line_m
        assert least_steps(start(ball_x - REACH_M - 0.01, (ball_x, 0.0)), ROUND, ball_m_s=1.0) == steps


def test_ways_are_straight_and_end_at_the_nearest_point_of_the_line() -> None:
    """The ball lies 0.3 m off the line and 0.4 m beside the goal mouth, half of which is 0.2 m: 0.5 m to go."""
    ball = (GOAL_X_M - 0.3, 0.6)
    along = REACH_M / sqrt(2.0)
    for sign in (1.0, -1.0):
        placed = start(ball[0] - along, (ball[0], sign * ball[1]), robot_y_m=sign * (ball[1] - along))
        assert least_steps(placed, ROUND, ball_m_s=1.0) == 10
    assert least_steps(start(ball[0] - REACH_M, (GOAL_X_M - 0.3, 0.15), robot_y_m=0.15), ROUND, ball_m_s=1.0) == 6


def test_the_heading_does_not_matter_and_a_rolling_ball_is_refused() -> None:
    placed = start(-1.0, (0.55, 0.6))
    assert least_steps(placed._replace(robot_yaw_rad=3.0), DEFAULT) == least_steps(placed, DEFAULT)
    with pytest.raises(ValueError, match="lies still"):
        least_steps(placed._replace(ball_vx_m_s=0.1), DEFAULT)


def test_a_start_in_the_middle_by_hand() -> None:
    """1 m to a ball 1 m in front of the goal line. In 17 steps of 0.1 m/s each the robot drives 1.7 (1 + ... + 17) mm =
    25.5 cm, then 2.933 cm a step. It needs 0.9256 m: 22.85 steps more, so it arrives in step 40. The ball has 0.15 of that
    step; at 1.76 m/s it needs 34.09 steps for 1 m, so it is past the line in step 40 + 34."""
    assert pytest.approx(0.0744, abs=1e-4) == REACH_M
    ball_x = GOAL_X_M - 1.0
    assert least_steps(start(ball_x - 1.0, (ball_x, 0.0)), DEFAULT, TOP_SPEED_M_S) == 40 + 34
    assert fastest_kick_m_s(DEFAULT) == pytest.approx(1.2 * 1.76 * 0.05303 / 0.035, rel=1e-3)


def test_no_robot_drives_farther_than_the_bound_assumes() -> None:
    """Wheels that change at random, or only when they have had time, in either direction: |v| <= k a dt and the top speed."""
    rng = np.random.default_rng(2)
    for run in range(8):
        physics = Physics(DEFAULT)
        physics.reset(Start(0.0, 0.0, 0.0, 0.9, 0.8))
        command = (0.0, 0.0)
        for step in range(1, 60):
            if rng.random() < 1.0 / (1 + run):
                command = tuple(rng.choice([-1.0, -0.3, 0.0, 0.6, 1.0], size=2) * MAX_WHEEL_RAD_S)
            physics.step(*command)
            speed = hypot(physics.robot_speed_m_s, physics.robot_slip_m_s)
            assert speed <= min(step * 0.1, TOP_SPEED_M_S) + 1e-9
            if max(abs(physics.robot_x_m), abs(physics.robot_y_m)) > 0.75:
                break


@pytest.mark.parametrize("wheels", [(1.0, 1.0), (-1.0, 1.0), (0.4, 1.0), (-0.3, 0.8)])
def test_no_hit_is_harder_than_the_fastest_kick(wheels: tuple[float, float]) -> None:
    """Into a ball beside or in front of the robot, at any moment of a spin."""
    fastest = 0.0
    for ball_x in (0.062, 0.07, 0.3):
        for ball_y in (0.0, 0.02, 0.035):
            for yaw_rad in (0.0, 0.4):
                physics = Physics(DEFAULT)
                physics.reset(Start(0.0, 0.0, yaw_rad, ball_x, ball_y))
                for _ in range(40):
                    physics.step(wheels[0] * MAX_WHEEL_RAD_S, wheels[1] * MAX_WHEEL_RAD_S)
                    fastest = max(fastest, hypot(physics.ball_vx_m_s, physics.ball_vy_m_s))
    assert 0.5 < fastest <= fastest_kick_m_s(DEFAULT)


def test_the_tuned_law_never_undercuts_the_bound_and_is_not_far_above_it() -> None:
    loop, task = WorldLoop(), Task(DEFAULT)
    played = least = 0
    for seed in range(20):
        bound = least_steps(task.begin(seed), DEFAULT)
        pushed = least_steps(task.begin(seed), DEFAULT, TOP_SPEED_M_S)
        world = loop.reset(seed, seed)
        while not world.ended:
            world = loop.step(*law(world, TUNED))
        assert bound < pushed < ceil(1.6 * bound)
        assert world.step >= bound
        played, least = played + world.step, least + pushed
    assert played < 3 * least
