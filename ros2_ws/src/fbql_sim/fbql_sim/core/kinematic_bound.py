"""The kinematic bound: the steps that an episode takes at least, whatever drives the robot.

A law, even an ideal one, has to drive around the ball, and brake and turn to steer it; the bound ignores all of that.
"""

from __future__ import annotations

from math import ceil, hypot, sqrt

from fbql_common.core.field import AXLE_M, BALL_RADIUS_M, FIELD, MAX_WHEEL_RAD_S, ROBOT_SIDE_M, WHEEL_RADIUS_M

from fbql_sim.core.parameters import SimulationParameters
from fbql_sim.core.physics import Start
from fbql_sim.core.task import GOAL_X_M

TOP_SPEED_M_S = WHEEL_RADIUS_M * MAX_WHEEL_RAD_S
"""The robot's, straight on."""
REACH_M = ROBOT_SIDE_M / sqrt(2.0) + BALL_RADIUS_M
"""The largest distance of the two centres at which robot and ball touch: the ball at a corner of the robot."""


def fastest_kick_m_s(parameters: SimulationParameters) -> float:
    """A speed that the ball never exceeds after it was touched.

    No point of the robot is faster than a corner of one that spins on the spot at full wheel speed (a wheel's share of the
    speed is lost to turning at AXLE_M / 2 a radian, and a corner is farther from the centre than that). A ball at rest
    leaves a point that hits it at no more than 1 + e times its speed, as if the robot were infinitely heavy.
    """
    corner_m_s = TOP_SPEED_M_S * (ROBOT_SIDE_M / sqrt(2.0)) / (AXLE_M / 2)
    return (1.0 + parameters.ball_robot_restitution) * corner_m_s


def least_steps(start: Start, parameters: SimulationParameters, ball_m_s: float | None = None) -> int:
    """Steps from a start to a goal that no driving can undercut.

    Assumptions, each of which can only make the bound smaller than what is possible:

    - The robot drives straight to the ball, whatever its heading; from rest it gains the wheels' acceleration limit in each
      step, up to the top speed of its wheels.
    - It arrives when a corner could touch the ball; the ball is off at full speed at once.
    - The ball rolls straight to the nearest point of the line that it must pass, over walls and robot alike, and loses no
      speed.

    One that makes it larger, if it does not hold: the ball is never faster than `ball_m_s`. With the default
    (`fastest_kick_m_s`) it holds for every play. With TOP_SPEED_M_S it holds for play that never kicks the ball away faster
    than the robot can drive, such as pushing it all the way.

    Args:
        start: the start of an episode.
        ball_m_s: the highest speed of the ball; by default that of the fastest kick.

    Raises:
        ValueError: the ball rolls at the start, and could come to the robot.
    """
    if start.ball_vx_m_s or start.ball_vy_m_s:
        raise ValueError("the bound is for a ball that lies still at the start")
    if ball_m_s is None:
        ball_m_s = fastest_kick_m_s(parameters)
    to_ball_m = hypot(start.ball_x_m - start.robot_x_m, start.ball_y_m - start.robot_y_m) - REACH_M
    beside_m = max(abs(start.ball_y_m) - FIELD.half_goal_m, 0.0)
    to_goal_m = hypot(max(GOAL_X_M - start.ball_x_m, 0.0), beside_m)
    dt_s, step_m = parameters.dt_s, ball_m_s * parameters.dt_s
    speed_m_s = 0.0
    steps = 0
    while True:
        speed_m_s = min(speed_m_s + parameters.wheel_acceleration_m_s2 * dt_s, TOP_SPEED_M_S)
        driven_m = speed_m_s * dt_s
        steps += 1
        if driven_m >= to_ball_m:
            break
        to_ball_m -= driven_m
    # In the step in which they meet, the ball rolls for what is left of it.
    left_m = to_goal_m - step_m * (1.0 - max(to_ball_m, 0.0) / driven_m)
    return steps + max(ceil(left_m / step_m - 1e-9), 0)
