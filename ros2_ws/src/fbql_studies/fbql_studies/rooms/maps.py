"""Rooms of 10 x 10 m, made from seeds, each with a start and a goal, and kept only if the robot can get from one to the other.

There are two families. `traps`: a U across the straight line to the goal, open towards the start (60 %), or a wall through the whole
room with one gap (35 %). `doors`: two walls, crossing or parallel, with a door in each part. Both have clutter.
"""

from __future__ import annotations

from collections.abc import Callable
from math import atan2, cos, hypot, pi, sin
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fbql_studies.rooms.robot import RADIUS_M

SIZE_M = 10.0
WALL_M = 0.2
"""Thickness of a wall."""
NARROWEST_GAP_M, WIDEST_GAP_M = 0.75, 1.0
CLEARANCE_M = RADIUS_M + 0.05
"""The distance that a way must keep between the robot's center and every obstacle, so that a room counts as solvable."""
CELL_M = 0.1
"""The cell size of the grid on which ways are searched."""
_ATTEMPTS = 1000

Point = tuple[float, float]
Polygon = tuple[Point, ...]
"""Convex, corners counterclockwise."""


class Room(NamedTuple):
    """One room."""

    family: str
    seed: int
    obstacles: tuple[Polygon, ...]
    """The room's own four walls included."""
    start: tuple[float, float, float]
    """x, y [m] and yaw [rad] of the robot."""
    goal: Point


def room_of(family: str, seed: int) -> Room:
    """The room of a seed in one of FAMILIES: the first solvable one that its generator draws."""
    generator = np.random.default_rng([sorted(FAMILIES).index(family), seed])
    for _ in range(_ATTEMPTS):
        start, goal = _ends(generator)
        obstacles = (*_outer_walls(), *FAMILIES[family](generator, start, goal), *_clutter(generator, start, goal))
        if is_solvable(obstacles, start, goal):
            return Room(family, seed, obstacles, (*start, float(generator.uniform(-pi, pi))), goal)
    raise AssertionError(f"no solvable room for seed {seed} of {family}")


def rectangle(x: float, y: float, length: float, width: float, yaw: float) -> Polygon:
    """A rectangle around (x, y), whose length lies along yaw."""
    c, s = cos(yaw), sin(yaw)
    corners = ((-1, -1), (1, -1), (1, 1), (-1, 1))
    halves = [(sx * length / 2.0, sy * width / 2.0) for sx, sy in corners]
    return tuple((x + c * dx - s * dy, y + s * dx + c * dy) for dx, dy in halves)


def _outer_walls() -> tuple[Polygon, ...]:
    middle, out, long = SIZE_M / 2.0, WALL_M / 2.0, SIZE_M + 2.0 * WALL_M
    return (
        rectangle(middle, -out, long, WALL_M, 0.0),
        rectangle(SIZE_M + out, middle, WALL_M, long, 0.0),
        rectangle(middle, SIZE_M + out, long, WALL_M, 0.0),
        rectangle(-out, middle, WALL_M, long, 0.0),
    )


def _ends(generator: np.random.Generator) -> tuple[Point, Point]:
    """Start and goal: near opposite sides, the room turned by a random multiple of 90 degrees."""
    a, b = generator.uniform(1.0, 3.0), generator.uniform(SIZE_M - 3.0, SIZE_M - 1.0)
    p, q = generator.uniform(1.0, SIZE_M - 1.0, 2)
    ends = (float(a), float(p)), (float(b), float(q))
    turn = int(generator.integers(4))
    for _ in range(turn):
        ends = tuple((SIZE_M - y, x) for x, y in ends)  # type: ignore[assignment]  # two of them
    return ends


def _trap(generator: np.random.Generator, start: Point, goal: Point) -> list[Polygon]:
    """60 %: a U; 35 %: a wall with a gap; else nothing."""
    kind = generator.random()
    along = atan2(goal[1] - start[1], goal[0] - start[0]) + generator.uniform(-0.3, 0.3)
    share = generator.uniform(0.45, 0.65)
    x, y = (start[i] + share * (goal[i] - start[i]) for i in (0, 1))
    if kind < 0.6:
        width, depth = generator.uniform(1.6, 3.0), generator.uniform(1.0, 2.0)
        aside = generator.uniform(-0.3, 0.3) * width
        c, s = cos(along), sin(along)
        x, y = x - s * aside, y + c * aside
        sides = [
            rectangle(x - c * depth / 2 - s * side, y - s * depth / 2 + c * side, depth, WALL_M, along)
            for side in ((width - WALL_M) / 2, -(width - WALL_M) / 2)
        ]
        return [rectangle(x, y, WALL_M, width, along), *sides]
    if kind < 0.95:
        return wall_with_gap(x, y, along + pi / 2, generator)
    return []


def wall_with_gap(x: float, y: float, yaw: float, generator: np.random.Generator) -> list[Polygon]:
    """A straight wall through (x, y) from side to side, with a gap at least 0.7 m inside the room."""
    low, high = _span(x, y, yaw, 0.7)
    width = generator.uniform(NARROWEST_GAP_M, WIDEST_GAP_M)
    at = generator.uniform(low + width / 2, max(high - width / 2, low + width / 2))
    return _wall_parts(x, y, yaw, [float(at)], float(width))


def _span(x: float, y: float, yaw: float, margin: float) -> tuple[float, float]:
    """The part of a line through (x, y) that is that far inside the room, as distances along it."""
    low, high = -2.0 * SIZE_M, 2.0 * SIZE_M
    for origin, direction in ((x, cos(yaw)), (y, sin(yaw))):
        if abs(direction) > 1e-9:
            ends = sorted(((margin - origin) / direction, (SIZE_M - margin - origin) / direction))
            low, high = max(low, ends[0]), min(high, ends[1])
    return low, high


def _wall_parts(x: float, y: float, yaw: float, gaps: list[float], width: float) -> list[Polygon]:
    """The parts of a wall between gaps around these distances along it."""
    low, high = _span(x, y, yaw, -WALL_M / 2)
    ends = [low, *(end for at in sorted(gaps) for end in (at - width / 2, at + width / 2)), high]
    c, s = cos(yaw), sin(yaw)
    return [
        rectangle(x + c * (a + b) / 2, y + s * (a + b) / 2, b - a, WALL_M, yaw)
        for a, b in zip(ends[::2], ends[1::2], strict=True)
        if b - a > WALL_M
    ]


def _doors(generator: np.random.Generator, start: Point, goal: Point) -> list[Polygon]:
    """Two walls: parallel across the way with a door each (half of them), or a cross with a door in each arm."""
    width = float(generator.uniform(0.8, 1.2))
    middle = SIZE_M / 2
    is_along_x = abs(goal[0] - start[0]) > abs(goal[1] - start[1])
    across = pi / 2 if is_along_x else 0.0
    if generator.random() < 0.5:
        walls: list[Polygon] = []
        for place in (generator.uniform(3.2, 4.4), generator.uniform(5.6, 6.8)):
            x, y = (float(place), middle) if is_along_x else (middle, float(place))
            walls += _wall_parts(x, y, across, [float(generator.uniform(-3.8, 3.8))], width)
        return walls
    x, y = (float(each) for each in generator.uniform(4.2, 5.8, 2))
    doors = [[float(sign * generator.uniform(1.2, 3.4)) for sign in (-1, 1)] for _ in range(2)]
    return [*_wall_parts(x, y, 0.0, doors[0], width), *_wall_parts(x, y, pi / 2, doors[1], width)]


def _clutter(generator: np.random.Generator, start: Point, goal: Point) -> list[Polygon]:
    """2 to 5 boxes, none near the start or the goal."""
    boxes: list[Polygon] = []
    for _ in range(int(generator.integers(2, 6))):
        x, y = (float(each) for each in generator.uniform(0.5, SIZE_M - 0.5, 2))
        length, width = (float(each) for each in generator.uniform(0.3, 0.8, 2))
        yaw = float(generator.uniform(0.0, pi))
        if min(hypot(x - end[0], y - end[1]) for end in (start, goal)) > 1.1:
            boxes.append(rectangle(x, y, length, width, yaw))
    return boxes


def is_solvable(obstacles: tuple[Polygon, ...], start: Point, goal: Point) -> bool:
    """Whether the robot, with some clearance, gets from start to goal, on a grid of 0.1 m.

    An obstacle is grown by moving its edges outwards, corners and all: a little more than the robot needs.
    """
    is_free = free_cells(obstacles, CLEARANCE_M)
    first, last = ((int(y / CELL_M) + 1, int(x / CELL_M) + 1) for x, y in (start, goal))
    if not (is_free[first] and is_free[last]):
        return False
    met = np.zeros_like(is_free)
    met[first] = True
    edge = [first]
    while edge:
        row, column = edge.pop()
        if (row, column) == last:
            return True
        for cell in ((row + 1, column), (row - 1, column), (row, column + 1), (row, column - 1)):
            if is_free[cell] and not met[cell]:
                met[cell] = True
                edge.append(cell)
    return False


def free_cells(obstacles: tuple[Polygon, ...], clearance_m: float) -> NDArray[np.bool_]:
    """Which cells of the grid are that far from every obstacle, [y, x], in a frame of cells that are not."""
    cells = round(SIZE_M / CELL_M)
    is_free = np.zeros((cells + 2, cells + 2), dtype=np.bool_)
    is_free[1:-1, 1:-1] = ~_is_near(obstacles, cells, clearance_m).any(axis=0)
    return is_free


def _is_near(obstacles: tuple[Polygon, ...], cells: int, distance: float) -> NDArray[np.bool_]:
    """Which cells have their center inside each obstacle, grown by a distance, [obstacles, y, x]."""
    at = (np.arange(cells) + 0.5) * CELL_M
    inside = np.ones((len(obstacles), cells, cells), dtype=np.bool_)
    corners = np.array(obstacles)
    edges = np.roll(corners, -1, axis=1) - corners
    edges /= np.hypot(edges[..., 0], edges[..., 1])[..., None]
    for corner, edge in zip(corners.swapaxes(0, 1), edges.swapaxes(0, 1), strict=True):
        beyond = edge[:, 1, None] * (at - corner[:, 0, None])
        beside = edge[:, 0, None] * (at - corner[:, 1, None])
        inside &= beyond[:, None, :] - beside[:, :, None] < distance
    return inside


FAMILIES: dict[str, Callable[[np.random.Generator, Point, Point], list[Polygon]]] = {"traps": _trap, "doors": _doors}
