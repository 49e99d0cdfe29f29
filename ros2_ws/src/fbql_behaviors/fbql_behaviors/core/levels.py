"""The levels that the axes of a command space are rounded to, and the classes that combinations of levels make.

Each axis has evenly spaced levels from its low to its high end. A value is rounded to the nearest level, ties away from 0,
so that both directions are treated alike; a value beyond an end counts as the end. Levels are numbered from standstill: level
0 is the value 0 where that is a level of the axis, and otherwise the low end. A class numbers a combination of levels, the
first axis being the coarsest digit.
"""

from __future__ import annotations

from math import floor, prod

import numpy as np
import numpy.typing as npt
from fbql_common.core.command_space import Axis, Command, CommandSpace

_SAME = 1e-6
"""Share of a level up to which 0 counts as one of the levels."""


def step_of(axis: Axis) -> float:
    """The distance between two neighboring levels, in the axis's unit."""
    return (axis.high - axis.low) / (axis.levels - 1)


def origin_of(axis: Axis) -> float:
    """The value of level 0: 0, or the low end where 0 is not one of the levels."""
    below = -axis.low / step_of(axis)
    return 0.0 if abs(below - round(below)) < _SAME and 0 <= round(below) < axis.levels else axis.low


def lowest_of(axis: Axis) -> int:
    """The number of the lowest level."""
    return round((axis.low - origin_of(axis)) / step_of(axis))


def level_at(axis: Axis, value: float) -> int:
    """The level nearest to a finite value."""
    distance = value - origin_of(axis)
    lowest = lowest_of(axis)
    # Limited before it is rounded: a whole number can't hold every quotient of two floats.
    magnitude = floor(min(abs(distance) / step_of(axis), float(axis.levels)) + 0.5)
    return min(max(magnitude if distance >= 0.0 else -magnitude, lowest), lowest + axis.levels - 1)


def value_at(axis: Axis, level: float) -> float:
    """The value of a level, or of a mean of levels."""
    return origin_of(axis) + level * (axis.high - axis.low) / (axis.levels - 1)


def command_at(space: CommandSpace, levels: list[float]) -> Command:
    """The command of one level, or mean of levels, per axis."""
    return space.limited(tuple([value_at(axis, level) for axis, level in zip(space.axes, levels, strict=True)]))


def class_count(space: CommandSpace) -> int:
    """The number of classes."""
    return prod(axis.levels for axis in space.axes)


def class_at(space: CommandSpace, command: Command) -> int:
    """The class of a finite command."""
    number = 0
    for axis, value in zip(space.axes, command, strict=True):
        number = number * axis.levels + level_at(axis, value) - lowest_of(axis)
    return number


def levels_at(space: CommandSpace, classes: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """The levels of many classes: [n] -> [n, axes]."""
    columns: list[npt.NDArray[np.int64]] = []
    for axis in reversed(space.axes):
        classes, digit = np.divmod(classes, axis.levels)
        columns.append(digit + lowest_of(axis))
    return np.stack(columns[::-1], axis=1)


def in_levels(space: CommandSpace, commands: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Commands [n, axes] counted in levels."""
    origin, step = (np.array([of(axis) for axis in space.axes]) for of in (origin_of, step_of))
    return (commands - origin) / step
