"""The world model: what is fitted to the real steps, and the step that it predicts.

Two kinds. With structure (`regions`): robot and ball apart, each free or near something, eqs. 21 and 23 to 25. Without: one
regression of the change of the whole state on state and command, by extra-trees or linear.
"""

from __future__ import annotations

from math import cos, floor, pi, sin, sqrt, tau
from typing import NamedTuple

import numpy as np
from fbql_common.core.kernels import kernel
from fbql_common.core.walls import closest_wall

from fbql_fusion.core.learners.linear import Floats
from fbql_fusion.core.tasks.soccer.world_model.ball import (
    OUTPUTS,
    Rolling,
    ball_near,
    free_ball,
)
from fbql_fusion.core.tasks.soccer.world_model.bodies import ball_off_robot, ball_off_walls, robot_off_walls
from fbql_fusion.core.tasks.soccer.world_model.forest import Forest, leaf_of, no_forest
from fbql_fusion.core.tasks.soccer.world_model.parameters import FAMILIES
from fbql_fusion.core.tasks.soccer.world_model.real_steps import STATE
from fbql_fusion.core.tasks.soccer.world_model.robot import (
    NEAR_OUTPUTS,
    Wheels,
    free_robot,
    robot_near_wall,
    wheel_speeds,
)

State = tuple[float, float, float, float, float, float, float, float, float]
"""See `real_steps.STATE`."""
GENERIC_INPUTS = 12
"""Inputs of the model without structure: the state, with cosine and sine of the yaw in its place, and the command."""
GENERIC_OUTPUTS = len(STATE) + 1
"""Its outputs: the change of each component of the state, and the contact."""
SCRATCH = 16
"""Length of the array in which a step puts the inputs of the forests."""
REGIONS, FOREST, LINEAR = range(len(FAMILIES))


class WorldModel(NamedTuple):
    """What is fitted; the input of kernels."""

    family: int
    """Index in FAMILIES."""
    trees: int
    known_sizes: bool
    gap_steps: int
    """Steps without contact after which a contact is a new collision."""
    robot_wall_m: float
    """Distances below which the forests predict."""
    ball_robot_m: float
    ball_wall_m: float
    wheels: Wheels
    robot_wall: Forest
    ball_robot: Forest
    ball_wall: Forest
    rolling: Rolling
    whole: Forest
    """Of the family `forest`."""
    linear: Floats
    """Of the family `linear`: weights of the inputs and of 1, [GENERIC_INPUTS + 1, GENERIC_OUTPUTS]."""
    gain_deviation: float
    """Standard deviation of a wheel's gain, constant in an episode."""


EMPTY = WorldModel(
    REGIONS, 1, True, 1, 0.0, 0.0, 0.0,
    Wheels(np.zeros(1), np.zeros(1), 0.0, 0.0, 0.0),
    no_forest(NEAR_OUTPUTS), no_forest(OUTPUTS), no_forest(OUTPUTS), Rolling(1.0, 0.0),
    no_forest(GENERIC_OUTPUTS), np.zeros((GENERIC_INPUTS + 1, GENERIC_OUTPUTS)), 0.0,
)  # fmt: skip
"""What the parts that a family does not use are."""


@kernel
def wrapped(angle_rad: float) -> float:
    """The same direction in [-pi, pi]."""
    return angle_rad - tau * floor((angle_rad + pi) / tau)


@kernel
def next_state(
    model: WorldModel,
    state: State,
    command_left_m_s: float,
    command_right_m_s: float,
    scratch: Floats,
    generator: np.random.Generator,
) -> tuple[State, bool]:
    """One step, and whether the robot touched a wall in it.

    Eq. 26: one tree, drawn anew for each step, stands for each forest, so that a step has the spread of the real ones.

    Args:
        command_left_m_s, command_right_m_s: the wheels' ground speeds that are commanded.
        scratch: SCRATCH numbers, overwritten.
        generator: of the draws.
    """
    if model.family == REGIONS:
        after, contact = _step_by_regions(model, state, command_left_m_s, command_right_m_s, scratch, generator)
    else:
        after, contact = _step_of_whole(model, state, command_left_m_s, command_right_m_s, scratch, generator)
    touched = contact >= 1.0 or (contact > 0.0 and generator.random() < contact)
    return after, touched


@kernel
def _step_by_regions(
    model: WorldModel,
    state: State,
    command_left: float,
    command_right: float,
    x: Floats,
    generator: np.random.Generator,
) -> tuple[State, float]:
    robot_x, robot_y, yaw, speed, rate, ball_x, ball_y, vx, vy = state
    cosine, sine = cos(yaw), sin(yaw)
    tree = int(generator.random() * model.trees)

    left, right = wheel_speeds(speed, rate)
    robot = free_robot(model.wheels, left, right, command_left, command_right)
    wall_x, wall_y, normal_x, normal_y, _ = closest_wall(robot_x, robot_y)
    wall_m = (robot_x - wall_x) * normal_x + (robot_y - wall_y) * normal_y
    if wall_m < model.robot_wall_m and len(model.robot_wall.roots) > 0:
        ahead, aside = cosine * normal_x + sine * normal_y, cosine * normal_y - sine * normal_x
        turned_cosine, turned_sine = cos(robot.turn_rad), sin(robot.turn_rad)
        x[0], x[1], x[2], x[3] = speed, rate, robot.speed_m_s, robot.turn_rate_rad_s
        x[4] = wall_m + ahead * robot.along_m + aside * robot.left_m
        x[5] = -(turned_cosine * ahead + turned_sine * aside)
        x[6] = turned_sine * ahead - turned_cosine * aside
        robot = robot_near_wall(model.robot_wall, tree, x, robot)
    robot_x += cosine * robot.along_m - sine * robot.left_m
    robot_y += sine * robot.along_m + cosine * robot.left_m
    yaw = wrapped(yaw + robot.turn_rad)

    wall_x, wall_y, normal_x, normal_y, _ = closest_wall(ball_x, ball_y)
    wall_m = (ball_x - wall_x) * normal_x + (ball_y - wall_y) * normal_y
    dx, dy = ball_x - state[0], ball_y - state[1]
    robot_m = sqrt(dx * dx + dy * dy)
    ball = free_ball(model.rolling, vx, vy)
    ball_x += ball.moved_x_m
    ball_y += ball.moved_y_m
    vx += ball.change_x_m_s
    vy += ball.change_y_m_s
    by_robot = robot_m < model.ball_robot_m and len(model.ball_robot.roots) > 0
    if by_robot or (wall_m < model.ball_wall_m and len(model.ball_wall.roots) > 0):
        wall_m += ball.moved_x_m * normal_x + ball.moved_y_m * normal_y
        if by_robot:
            axis_x, axis_y = cos(yaw), sin(yaw)
            dx, dy = ball_x - robot_x, ball_y - robot_y
            x[0], x[1] = axis_x * dx + axis_y * dy, axis_x * dy - axis_y * dx
            x[2], x[3] = axis_x * vx + axis_y * vy - robot.speed_m_s, axis_x * vy - axis_y * vx
            x[4], x[5], x[6] = robot.speed_m_s, robot.turn_rate_rad_s, wall_m
            x[7], x[8] = axis_x * normal_x + axis_y * normal_y, axis_x * normal_y - axis_y * normal_x
            ball = ball_near(model.ball_robot, tree, x)
        else:
            axis_x, axis_y = normal_x, normal_y
            x[0], x[1], x[2] = wall_m, normal_x * vx + normal_y * vy, normal_x * vy - normal_y * vx
            ball = ball_near(model.ball_wall, tree, x)
        vx += axis_x * ball.change_x_m_s - axis_y * ball.change_y_m_s
        vy += axis_y * ball.change_x_m_s + axis_x * ball.change_y_m_s
        ball_x += axis_x * ball.moved_x_m - axis_y * ball.moved_y_m
        ball_y += axis_y * ball.moved_x_m + axis_x * ball.moved_y_m

    after = (robot_x, robot_y, yaw, robot.speed_m_s, robot.turn_rate_rad_s, ball_x, ball_y, vx, vy)
    if model.known_sizes:
        after = apart(after)
    return after, robot.contact


@kernel
def _step_of_whole(
    model: WorldModel,
    state: State,
    command_left: float,
    command_right: float,
    x: Floats,
    generator: np.random.Generator,
) -> tuple[State, float]:
    robot_x, robot_y, yaw, speed, rate, ball_x, ball_y, vx, vy = state
    x[0], x[1], x[2], x[3], x[4], x[5] = robot_x, robot_y, cos(yaw), sin(yaw), speed, rate
    x[6], x[7], x[8], x[9], x[10], x[11] = ball_x, ball_y, vx, vy, command_left, command_right
    if model.family == FOREST:
        y = model.whole.outputs[leaf_of(model.whole, int(generator.random() * model.trees), x)]
    else:
        y = model.linear[GENERIC_INPUTS].copy()
        for i in range(GENERIC_INPUTS):
            for k in range(GENERIC_OUTPUTS):
                y[k] += x[i] * model.linear[i, k]
    after = (
        robot_x + y[0],
        robot_y + y[1],
        wrapped(yaw + y[2]),
        speed + y[3],
        rate + y[4],
        ball_x + y[5],
        ball_y + y[6],
        vx + y[7],
        vy + y[8],
    )
    if model.known_sizes:
        after = apart(after)
    return after, y[9]


@kernel
def apart(state: State) -> State:
    """Eq. 27 for a whole state: the robot off the walls, the ball off the robot and off the walls."""
    robot_x, robot_y, yaw, speed, rate, ball_x, ball_y, vx, vy = state
    cosine, sine = cos(yaw), sin(yaw)
    robot_x, robot_y = robot_off_walls(robot_x, robot_y, cosine, sine)
    dx, dy = ball_x - robot_x, ball_y - robot_y
    ahead, left = cosine * dx + sine * dy, cosine * dy - sine * dx
    x, y = ball_off_robot(ahead, left)
    if x != ahead or y != left:
        ball_x, ball_y = robot_x + cosine * x - sine * y, robot_y + sine * x + cosine * y
    ball_x, ball_y = ball_off_walls(ball_x, ball_y)
    return robot_x, robot_y, yaw, speed, rate, ball_x, ball_y, vx, vy
