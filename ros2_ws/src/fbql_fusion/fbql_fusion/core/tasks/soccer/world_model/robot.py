"""Eqs. 21 and 23: how the robot follows a wheel command, free and near a wall. Pure functions.

A wall's effect is a correction of free motion, so that nothing has to be learned where nothing touches.

A wheel's speed is along the ground [m/s]: that of the robot at the wheel, seen from its speed and turn rate.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from fbql_common.core.field import AXLE_M
from fbql_common.core.kernels import kernel

from fbql_fusion.core.learners.linear import Floats
from fbql_fusion.core.tasks.soccer.world_model.forest import Forest, leaf_of

_HALF_AXLE = AXLE_M / 2
NEAR_INPUTS = 7
"""Inputs of the forest near a wall: speed and turn rate, and, if the robot moved freely, the next speed and turn rate, and the
wall's next distance and the cosine and sine of its bearing."""
NEAR_OUTPUTS = 6
"""Its outputs: the differences from free motion of the displacement along and to the left, turn, speed and turn rate; contact."""


class Wheels(NamedTuple):
    """How the free robot moves."""

    errors: Floats
    """Mean of commanded - present speed in each bin [m/s], increasing, [B]."""
    changes: Floats
    """Mean change of the speed in a step [m/s], [B]."""
    advance: float
    """Displacement along the heading per speed [s]."""
    drift: float
    """Displacement to the left per speed times turn rate [s^2]."""
    turn: float
    """Turn per turn rate [s]."""


class RobotMotion(NamedTuple):
    """The motion of the robot in one step, in its frame before the step."""

    along_m: float
    left_m: float
    turn_rad: float
    speed_m_s: float
    turn_rate_rad_s: float
    contact: float
    """Probability that it touches a wall."""


@kernel
def interpolated(x: float, at: Floats, values: Floats) -> float:
    """The piecewise linear function through (at, values), [B]; constant beyond its ends."""
    low, high = 0, len(at)
    while low < high:
        middle = (low + high) // 2
        if x < at[middle]:
            high = middle
        else:
            low = middle + 1
    if low == 0:
        return values[0]
    if low == len(at):
        return values[low - 1]
    share = (x - at[low - 1]) / (at[low] - at[low - 1])
    return values[low - 1] + share * (values[low] - values[low - 1])


@kernel
def wheel_speeds(speed_m_s: float, turn_rate_rad_s: float) -> tuple[float, float]:
    """The ground speeds of the left and the right wheel."""
    turn = turn_rate_rad_s * _HALF_AXLE
    return speed_m_s - turn, speed_m_s + turn


@kernel
def free_robot(wheels: Wheels, left: float, right: float, command_left: float, command_right: float) -> RobotMotion:
    """Eq. 21: u_i' = u_i + g(c_i - u_i) for each wheel; speed and turn rate follow, and from them the displacement.

    Args:
        left, right: the wheels' speeds u [m/s].
        command_left, command_right: the commanded ones c [m/s].
    """
    left += interpolated(command_left - left, wheels.errors, wheels.changes)
    right += interpolated(command_right - right, wheels.errors, wheels.changes)
    speed = 0.5 * (left + right)
    rate = (right - left) / AXLE_M
    return RobotMotion(wheels.advance * speed, wheels.drift * speed * rate, wheels.turn * rate, speed, rate, 0.0)


@kernel
def robot_near_wall(forest: Forest, tree: int, x: Floats, free: RobotMotion) -> RobotMotion:
    """Eq. 23: free motion, corrected for the wall by the prediction of one tree.

    Args:
        x: NEAR_INPUTS numbers.
        free: the prediction of eq. 21.
    """
    leaf = leaf_of(forest, tree, x)
    y = forest.outputs[leaf]
    return RobotMotion(
        free.along_m + y[0],
        free.left_m + y[1],
        free.turn_rad + y[2],
        free.speed_m_s + y[3],
        free.turn_rate_rad_s + y[4],
        y[5],
    )


def fit_wheels(errors: Floats, changes: Floats, moved: Floats, after: Floats, bins: int) -> Wheels:
    """How the free robot moves, by N steps.

    Args:
        errors: commanded - present speed of each wheel [m/s], [N, 2].
        changes: of its speed in the step [m/s], [N, 2].
        moved: displacement along the heading, to the left [m], and turn [rad], [N, 3].
        after: speed and turn rate after the step, [N, 2].
        bins: number of parts into which quantiles of the errors divide the steps.
    """
    x, y = errors.ravel(), changes.ravel()
    edges = np.unique(np.quantile(x, np.linspace(0.0, 1.0, bins + 1)[1:-1]))
    own = np.searchsorted(edges, x, side="right")
    counts = np.bincount(own, minlength=len(edges) + 1)
    met = counts > 0
    means = [np.bincount(own, weights=each, minlength=len(counts))[met] / counts[met] for each in (x, y)]
    distinct = np.concatenate([[True], np.diff(means[0]) > 0.0])
    speed, rate = after.T
    return Wheels(
        means[0][distinct],
        means[1][distinct],
        slope(speed, moved[:, 0]),
        slope(speed * rate, moved[:, 1]),
        slope(rate, moved[:, 2]),
    )


def slope(x: Floats, y: Floats) -> float:
    """The least-squares slope of y = slope x; 0 where x is always 0."""
    square = float((x * x).sum())
    return float((x * y).sum()) / square if square > 0.0 else 0.0
