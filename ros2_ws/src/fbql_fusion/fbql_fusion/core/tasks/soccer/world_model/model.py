"""The world model: what is fitted to the real steps, and the step that it predicts.

There are two kinds. With structure (`regions`): robot and ball separately, each free or near something, eqs. 21 and 23 to 25.
Without: one regression of the change of the whole state on state and command, by extra-trees, nearest neighbors or linear.
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
from fbql_fusion.core.tasks.soccer.world_model.bodies import (
    ROBOT_REACH_M,
    TOUCH_M,
    ball_off_robot,
    ball_off_walls,
    robot_off_walls,
    room,
)
from fbql_fusion.core.tasks.soccer.world_model.forest import Forest, leaf_of, no_forest
from fbql_fusion.core.tasks.soccer.world_model.neighbours import Neighbours, nearest, no_neighbours
from fbql_fusion.core.tasks.soccer.world_model.parameters import FAMILIES
from fbql_fusion.core.tasks.soccer.world_model.real_steps import STATE
from fbql_fusion.core.tasks.soccer.world_model.robot import (
    NEAR_OUTPUTS,
    RobotMotion,
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
REGIONS, FOREST, NEIGHBOURS, LINEAR = range(len(FAMILIES))


class WorldModel(NamedTuple):
    """The fitted model, as kernels take it."""

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
    neighbours: Neighbours
    """Of the family `neighbours`."""
    nearest: int
    """Its neighbours of which one is drawn."""
    linear: Floats
    """Of the family `linear`: weights of the inputs and of 1, [GENERIC_INPUTS + 1, GENERIC_OUTPUTS]."""
    gain_deviation: float
    """Standard deviation of a wheel's gain, constant in an episode."""


EMPTY = WorldModel(
    REGIONS, 1, True, 1, 0.0, 0.0, 0.0,
    Wheels(np.zeros(1), np.zeros(1), 0.0, 0.0, 0.0),
    no_forest(NEAR_OUTPUTS), no_forest(OUTPUTS), no_forest(OUTPUTS), Rolling(1.0, 0.0),
    no_forest(GENERIC_OUTPUTS), no_neighbours(GENERIC_INPUTS, GENERIC_OUTPUTS), 1, np.zeros((GENERIC_INPUTS + 1, GENERIC_OUTPUTS)), 0.0,
)  # fmt: skip
"""The values of the parts that a family does not use."""


@kernel
def wrapped(angle_rad: float) -> float:
    """An angle as the same direction in [-pi, pi]."""
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

    Eq. 26: one tree, drawn anew for each step, stands for each forest, and one row for its neighbours, so that a step has the
    spread of the real ones.

    Args:
        command_left_m_s, command_right_m_s: the commanded ground speeds of the wheels.
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
    tree = int(generator.random() * model.trees)
    robot_x, robot_y, yaw = state[0], state[1], state[2]
    robot = _robot_moves(model, state, command_left, command_right, tree, x)
    cosine, sine = cos(yaw), sin(yaw)
    robot_x += cosine * robot.along_m - sine * robot.left_m
    robot_y += sine * robot.along_m + cosine * robot.left_m
    yaw = wrapped(yaw + robot.turn_rad)
    ball_x, ball_y, vx, vy = _ball_moves(model, state, robot_x, robot_y, yaw, robot, tree, x)
    after = (robot_x, robot_y, yaw, robot.speed_m_s, robot.turn_rate_rad_s, ball_x, ball_y, vx, vy)
    if model.known_sizes:
        after = apart(after)
    return after, robot.contact


@kernel
def _robot_moves(
    model: WorldModel, state: State, command_left: float, command_right: float, tree: int, x: Floats
) -> RobotMotion:
    robot_x, robot_y, yaw, speed, rate = state[0], state[1], state[2], state[3], state[4]
    left, right = wheel_speeds(speed, rate)
    free = free_robot(model.wheels, left, right, command_left, command_right)
    if len(model.robot_wall.roots) == 0 or room(robot_x, robot_y) >= model.robot_wall_m:
        return free
    wall_x, wall_y, normal_x, normal_y, _ = closest_wall(robot_x, robot_y)
    wall_m = (robot_x - wall_x) * normal_x + (robot_y - wall_y) * normal_y
    if wall_m >= model.robot_wall_m:
        return free
    cosine, sine = cos(yaw), sin(yaw)
    ahead, aside = cosine * normal_x + sine * normal_y, cosine * normal_y - sine * normal_x
    cosine, sine = cos(free.turn_rad), sin(free.turn_rad)
    x[0], x[1], x[2], x[3] = speed, rate, free.speed_m_s, free.turn_rate_rad_s
    x[4] = wall_m + ahead * free.along_m + aside * free.left_m
    x[5], x[6] = -(cosine * ahead + sine * aside), sine * ahead - cosine * aside
    return robot_near_wall(model.robot_wall, tree, x, free)


@kernel
def _ball_moves(
    model: WorldModel,
    state: State,
    robot_x: float,
    robot_y: float,
    yaw: float,
    robot: RobotMotion,
    tree: int,
    x: Floats,
) -> tuple[float, float, float, float]:
    """The ball's next place and velocity.

    Args:
        state: before the step.
        robot_x, robot_y, yaw: the robot's next place.
    """
    ball_x, ball_y, vx, vy = state[5], state[6], state[7], state[8]
    dx, dy = ball_x - state[0], ball_y - state[1]
    by_robot = len(model.ball_robot.roots) > 0 and sqrt(dx * dx + dy * dy) < model.ball_robot_m
    by_wall = not by_robot and len(model.ball_wall.roots) > 0 and room(ball_x, ball_y) < model.ball_wall_m
    wall_m = normal_x = normal_y = 0.0
    if by_robot or by_wall:
        wall_x, wall_y, normal_x, normal_y, _ = closest_wall(ball_x, ball_y)
        wall_m = (ball_x - wall_x) * normal_x + (ball_y - wall_y) * normal_y
        by_wall = by_wall and wall_m < model.ball_wall_m
    free = free_ball(model.rolling, vx, vy)
    ball_x, ball_y = ball_x + free.moved_x_m, ball_y + free.moved_y_m
    vx, vy = vx + free.change_x_m_s, vy + free.change_y_m_s
    if not (by_robot or by_wall):
        return ball_x, ball_y, vx, vy
    wall_m += free.moved_x_m * normal_x + free.moved_y_m * normal_y
    if by_robot:
        axis_x, axis_y = cos(yaw), sin(yaw)
        dx, dy = ball_x - robot_x, ball_y - robot_y
        x[0], x[1] = axis_x * dx + axis_y * dy, axis_x * dy - axis_y * dx
        x[2], x[3] = axis_x * vx + axis_y * vy - robot.speed_m_s, axis_x * vy - axis_y * vx
        x[4], x[5], x[6] = robot.speed_m_s, robot.turn_rate_rad_s, wall_m
        x[7], x[8] = axis_x * normal_x + axis_y * normal_y, axis_x * normal_y - axis_y * normal_x
        correction = ball_near(model.ball_robot, tree, x)
    else:
        axis_x, axis_y = normal_x, normal_y
        x[0], x[1], x[2] = wall_m, normal_x * vx + normal_y * vy, normal_x * vy - normal_y * vx
        correction = ball_near(model.ball_wall, tree, x)
    return (
        ball_x + (axis_x * correction.moved_x_m - axis_y * correction.moved_y_m),
        ball_y + (axis_y * correction.moved_x_m + axis_x * correction.moved_y_m),
        vx + (axis_x * correction.change_x_m_s - axis_y * correction.change_y_m_s),
        vy + (axis_y * correction.change_x_m_s + axis_x * correction.change_y_m_s),
    )


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
    elif model.family == NEIGHBOURS:
        rows = nearest(model.neighbours, x, model.nearest)
        y = model.neighbours.outputs[rows[int(generator.random() * len(rows))]]
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
    if room(robot_x, robot_y) < ROBOT_REACH_M:
        robot_x, robot_y = robot_off_walls(robot_x, robot_y, cos(yaw), sin(yaw))
    dx, dy = ball_x - robot_x, ball_y - robot_y
    if dx * dx + dy * dy < TOUCH_M * TOUCH_M:
        cosine, sine = cos(yaw), sin(yaw)
        ahead, left = cosine * dx + sine * dy, cosine * dy - sine * dx
        x, y = ball_off_robot(ahead, left)
        if x != ahead or y != left:
            ball_x, ball_y = robot_x + cosine * x - sine * y, robot_y + sine * x + cosine * y
    ball_x, ball_y = ball_off_walls(ball_x, ball_y)
    return robot_x, robot_y, yaw, speed, rate, ball_x, ball_y, vx, vy
