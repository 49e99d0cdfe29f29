"""The paper's 29 levels of a wheel velocity, and the 29 * 29 = 841 classes of a wheel pair (section II.A.2).

A level is a whole number from -14 to 14; level 0 is standstill and one level is 1/14 of the full wheel velocity. A
velocity is rounded to the nearest level, ties away from zero, so that forwards and backwards are treated alike; a velocity
beyond full counts as full. A wheel_class numbers a pair of levels, 0 .. 840, with the left wheel as the coarse digit.
"""

from __future__ import annotations

from math import isfinite

import numpy as np
import numpy.typing as npt
from fbql_common.core.errors import BadInput
from fbql_common.core.field import MAX_WHEEL_RAD_S, WHEELS

from fbql_behaviors.core.levels import level_at, levels_at, value_at

MAX_LEVEL = 14
LEVEL_COUNT = 2 * MAX_LEVEL + 1
CLASS_COUNT = LEVEL_COUNT * LEVEL_COUNT
LEVEL_RAD_S = MAX_WHEEL_RAD_S / MAX_LEVEL
"""One level [rad/s]."""


def level_of(wheel_rad_s: float) -> int:
    """The level nearest to a wheel velocity [rad/s]. Raises BadInput when it is not finite."""
    if not isfinite(wheel_rad_s):
        raise BadInput(f"wheel velocity {wheel_rad_s} rad/s is not finite; a level needs a number")
    return level_at(WHEELS.axes[0], wheel_rad_s)


def rad_s_of(level: float) -> float:
    """The wheel velocity [rad/s] of a level, or of a mean of levels."""
    return value_at(WHEELS.axes[0], level)


def wheel_class_of(left_rad_s: float, right_rad_s: float) -> int:
    """The wheel_class of a pair of wheel velocities [rad/s]."""
    return class_of_levels(level_of(left_rad_s), level_of(right_rad_s))


def class_of_levels(left: int, right: int) -> int:
    """The wheel_class of a pair of levels."""
    return (left + MAX_LEVEL) * LEVEL_COUNT + right + MAX_LEVEL


def levels_of(wheel_class: int) -> tuple[int, int]:
    """The levels (left, right) of a wheel_class."""
    left, right = divmod(wheel_class, LEVEL_COUNT)
    return left - MAX_LEVEL, right - MAX_LEVEL


def levels_of_classes(wheel_class: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """The levels of many wheel classes: [n] -> [n, 2], columns left and right."""
    return levels_at(WHEELS, wheel_class)
