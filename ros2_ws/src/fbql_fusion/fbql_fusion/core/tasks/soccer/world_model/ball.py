"""Eqs. 24 and 25: how the ball moves near the robot or a wall, and free. Pure functions.

Each is in the frame of what is near, so that what was seen in one place holds in all.
"""

from __future__ import annotations

from typing import NamedTuple

from fbql_common.core.kernels import kernel

from fbql_fusion.core.learners.linear import Floats
from fbql_fusion.core.tasks.soccer.world_model.forest import Forest, leaf_of
from fbql_fusion.core.tasks.soccer.world_model.robot import slope

ROBOT_INPUTS = 9
"""Inputs of the forest near the robot, in its next frame: the place that a free ball would have next, its velocity relative to
the robot's, the robot's next speed and turn rate, the distance that the closest wall would have from the ball, its normal."""
WALL_INPUTS = 3
"""Inputs of the forest near a wall: the distance that a free ball would have next, its speed off the wall and along it."""
OUTPUTS = 4
"""Outputs of both: the differences of velocity and displacement from those of a free ball, two components each."""


class BallMotion(NamedTuple):
    """The motion of the ball in one step, in some frame."""

    change_x_m_s: float
    change_y_m_s: float
    moved_x_m: float
    moved_y_m: float


class Rolling(NamedTuple):
    """How the free ball rolls."""

    keep: float
    """Share of its velocity that it keeps in a step."""
    travel_s: float
    """Displacement in a step, per velocity [s]."""


@kernel
def ball_near(forest: Forest, tree: int, x: Floats) -> BallMotion:
    """Eq. 24: how the robot or a wall changes the motion of a free ball, as one tree predicts it.

    Args:
        x: ROBOT_INPUTS numbers in the robot's next frame, or WALL_INPUTS numbers in the wall's.
    """
    leaf = leaf_of(forest, tree, x)
    y = forest.outputs[leaf]
    return BallMotion(y[0], y[1], y[2], y[3])


@kernel
def free_ball(rolling: Rolling, vx_m_s: float, vy_m_s: float) -> BallMotion:
    """Eq. 25: v' = keep v, and the ball moves by travel v."""
    loss = rolling.keep - 1.0
    return BallMotion(loss * vx_m_s, loss * vy_m_s, rolling.travel_s * vx_m_s, rolling.travel_s * vy_m_s)


def fit_rolling(before: Floats, after: Floats, moved: Floats) -> Rolling:
    """How the free ball rolls, by its velocities before and after N steps [m/s] and its displacement [m], [N, 2] each."""
    return Rolling(slope(before.ravel(), after.ravel()), slope(before.ravel(), moved.ravel()))
