"""A scripted operator, who drives the robot with a keyboard, as a person who looks down into the room would.

It plans the shortest way on a grid and follows it with three keys: forwards, left, right. So it demonstrates what no source can
know: the way round. A tree can learn only the part of it that shows in the scan and the goal.
"""

from __future__ import annotations

from math import atan2, hypot

import numpy as np
from fbql_common.core.geometry import wrap_bearing
from numpy.typing import NDArray

from fbql_studies.rooms.maps import CELL_M, SIZE_M, Point, Room, free_cells
from fbql_studies.rooms.robot import Reading
from fbql_studies.rooms.sources import Command

FORWARD_M_S, TURN_RAD_S = 0.6, 1.0
"""The effects of the keys."""
CLEARANCE_M = 0.35
_NARROW_M = 0.25
"""Kept where there is no way with CLEARANCE_M."""
_AHEAD_M = 0.6
_BESIDE_THE_WAY = 1000.0
_NEIGHBOURS = [(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1) if i or j]
_ON_THE_SPOT_RAD, _STRAIGHT_RAD = 0.7, 0.2


class Operator:
    """One drive through a room."""

    def __init__(self, room: Room) -> None:
        self._distance = _distances(free_cells(room.obstacles, CLEARANCE_M), room.goal)
        if self._distance[_cell(room.start[:2])] > _BESIDE_THE_WAY:
            self._distance = _distances(free_cells(room.obstacles, _NARROW_M), room.goal)

    def keys(self, reading: Reading) -> Command:
        """The command of the keys that are pressed now."""
        x, y = self._ahead(reading.x_m, reading.y_m)
        bearing = wrap_bearing(atan2(y - reading.y_m, x - reading.x_m) - reading.yaw_rad)
        turn = 0.0 if abs(bearing) < _STRAIGHT_RAD else TURN_RAD_S if bearing > 0.0 else -TURN_RAD_S
        return (0.0 if abs(bearing) > _ON_THE_SPOT_RAD else FORWARD_M_S, turn)

    def _ahead(self, x: float, y: float) -> Point:
        """A point of the way, some distance ahead."""
        cell = _cell((x, y))
        while True:
            better = min(_around(cell), key=lambda each: self._distance[each])
            if not self._distance[better] < self._distance[cell]:
                break
            cell = better
            at = _middle(cell)
            if hypot(at[0] - x, at[1] - y) > _AHEAD_M:
                break
        return _middle(cell)


def _cell(at: Point) -> tuple[int, int]:
    """The cell of a point; a frame of cells that are not free surrounds the room."""
    most = round(SIZE_M / CELL_M)
    return min(max(int(at[1] / CELL_M), 0), most - 1) + 1, min(max(int(at[0] / CELL_M), 0), most - 1) + 1


def _middle(cell: tuple[int, int]) -> Point:
    return (cell[1] - 0.5) * CELL_M, (cell[0] - 0.5) * CELL_M


def _around(cell: tuple[int, int]) -> list[tuple[int, int]]:
    row, column = cell
    return [(row + i, column + j) for i, j in _NEIGHBOURS]


def _distances(is_free: NDArray[np.bool_], goal: Point) -> NDArray[np.float64]:
    """The length of the shortest way from each cell to the goal, in cells. One through a cell that is not free counts as
    _BESIDE_THE_WAY, so that a robot beside the way finds back to it; the frame is never passed."""
    costs = np.full(is_free.shape, np.inf)
    costs[1:-1, 1:-1] = np.where(is_free[1:-1, 1:-1], 1.0, _BESIDE_THE_WAY)
    found = np.full(is_free.shape, np.inf)
    found[_cell(goal)] = 0.0
    while True:
        before = found.copy()
        for i, j in _NEIGHBOURS:
            np.minimum(found, np.roll(before, (i, j), axis=(0, 1)) + hypot(i, j) * costs, out=found)
        if (found == before).all():
            return found
