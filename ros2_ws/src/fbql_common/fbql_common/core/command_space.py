"""The commands that a robot takes: their axes, each with its unit and limits."""

from __future__ import annotations

from typing import NamedTuple

Command = tuple[float, ...]
"""One value per axis of a command space, in its order and units."""


class Axis(NamedTuple):
    """One component of a command."""

    name: str
    unit: str
    low: float
    high: float
    levels: int
    """How many values, evenly spaced from low to high, a behavior's demonstrations are rounded to."""


class CommandSpace(NamedTuple):
    """The axes of a command, in order."""

    axes: tuple[Axis, ...]

    @property
    def standstill(self) -> Command:
        """0 on every axis."""
        return (0.0,) * len(self.axes)

    def limited(self, command: Command) -> Command:
        """The command with each value moved to the nearest within its axis's limits."""
        return tuple([min(max(x, axis.low), axis.high) for x, axis in zip(command, self.axes, strict=True)])
