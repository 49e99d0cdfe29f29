"""The robot: a differential drive with a laser scanner all around, and its readings. Lengths in m, angles in rad."""

from __future__ import annotations

from math import atan2, hypot, pi
from typing import NamedTuple

import numpy as np
from fbql_common.core.command_space import Axis, CommandSpace
from fbql_common.core.geometry import wrap_bearing
from numpy.typing import NDArray

RADIUS_M = 0.2
PERIOD_S = 0.1
BEAMS = 72
RANGE_M = 3.0
GOAL_RADIUS_M = 0.3
MAX_STEPS = 400
"""Steps after which an episode is truncated, and what a failure costs."""
SPACE = CommandSpace((Axis("linear.x", "m/s", -0.4, 0.8, 5), Axis("angular.z", "rad/s", -1.5, 1.5, 5)))
BEAM_RAD = 2.0 * pi / BEAMS
ANGLES: NDArray[np.float64] = BEAM_RAD * np.arange(BEAMS) - pi
"""Direction of each beam in the robot's frame, counterclockwise from behind."""

Ranges = NDArray[np.float64]
"""[BEAMS]; RANGE_M where nothing is in range."""


class Reading(NamedTuple):
    """What the robot knows after a step, and how the step ended."""

    step: int
    x_m: float
    y_m: float
    yaw_rad: float
    ranges: Ranges
    goal_distance_m: float
    goal_bearing_rad: float
    """Left positive, -pi to pi."""
    collided: bool

    @property
    def reached(self) -> bool:
        """Whether the robot is at the goal."""
        return self.goal_distance_m <= GOAL_RADIUS_M and not self.collided

    @property
    def terminated(self) -> bool:
        """The episode ended, for a reason other than time."""
        return self.collided or self.reached

    @property
    def truncated(self) -> bool:
        """The time limit was reached."""
        return self.step >= MAX_STEPS and not self.terminated


def reading_of(
    step: int, pose: tuple[float, float, float], ranges: Ranges, goal: tuple[float, float], collided: bool
) -> Reading:
    """The reading at a pose (x, y, yaw)."""
    x, y, yaw = pose
    dx, dy = goal[0] - x, goal[1] - y
    return Reading(step, x, y, yaw, ranges, hypot(dx, dy), wrap_bearing(atan2(dy, dx) - yaw), collided)
