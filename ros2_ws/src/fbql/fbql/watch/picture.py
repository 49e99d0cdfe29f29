"""The field from above as characters: walls, goals, the ball, the robot, where it is heading, and where both
have been.

In Unicode each character is a braille pattern of 2 x 4 dots: at 80 x 24 characters a dot is 2.5 cm, so that the robot is a
small square, the ball a speck, and contact can be seen. In ASCII each character is one thing. Everything differs in shape;
color only helps.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from math import ceil, cos, hypot, sin, tau
from typing import NamedTuple

from fbql_common.core.field import BALL_RADIUS_M, FIELD, ROBOT_SIDE_M
from fbql_common.core.types import World
from fbql_common.terminal.screen import Line
from fbql_sim.core.arena import HALF_GOAL, HALF_LENGTH, HALF_WIDTH, POCKET, SEGMENTS

_Inside = Callable[[float, float], bool]
"""Whether a point of a body's own frame [m] belongs to it."""

_NOTHING, _ROBOT_TRAIL, _BALL_TRAIL, _WALL, _OWN_GOAL, _GOAL, _RAY, _BALL, _ROBOT = range(9)
"""Kinds of things; a later one covers an earlier one."""
_STYLES = ("", "2;36", "2;33", "2", "34", "32", "36", "1;33", "1;36")
_ASCII = " .,#[]*oR"
_HEADINGS = ">/^\\</v\\"
"""The robot in ASCII, by eighths of a turn."""
_BRAILLE = 0x2800
_BITS = ((0x01, 0x08), (0x02, 0x10), (0x04, 0x20), (0x40, 0x80))
"""Bit of a braille dot, by row and column in its character."""
TRAIL_EVERY = 4
"""Steps between two points of a trail: with 60 steps a second the dots are apart."""
TRAIL_POINTS = 60
"""Length of a trail: 4 s."""
NOSE_M = 0.15
"""How far the line ahead of the robot reaches from its center [m]."""


class Trail(NamedTuple):
    """Where robot and ball have been: points (x, y) [m]."""

    robot: Iterable[tuple[float, float]] = ()
    ball: Iterable[tuple[float, float]] = ()


def field_picture(
    world: World,
    columns: int,
    rows: int,
    ascii_only: bool = False,
    trail: Trail = Trail(),  # noqa: B008 - immutable
) -> list[Line]:
    """A picture of at most `columns` x `rows` characters, as large as fits, x to the right and y upwards.

    At least 8 x 4 characters.
    """
    canvas = _Canvas(columns, rows, ascii_only)
    for points, thing in ((trail.robot, _ROBOT_TRAIL), (trail.ball, _BALL_TRAIL)):
        for x, y in points:
            canvas.dot(x, y, thing)
    for (x0, y0), (x1, y1) in SEGMENTS:
        canvas.line(x0, y0, x1, y1, _WALL)
    for side, thing in ((-1.0, _OWN_GOAL), (1.0, _GOAL)):
        canvas.line(side * POCKET, -HALF_GOAL, side * POCKET, HALF_GOAL, thing)
        for end in (-1.0, 1.0):
            canvas.line(side * HALF_LENGTH, end * HALF_GOAL, side * POCKET, end * HALF_GOAL, thing)
    canvas.ball(world)
    canvas.robot(world)
    return canvas.lines()


class _Canvas:
    """Dots, and for each character the topmost thing in it."""

    def __init__(self, columns: int, rows: int, ascii_only: bool) -> None:
        self._ascii = ascii_only
        self._dots = across, up = (1, 1) if ascii_only else (2, 4)
        # A braille dot is as wide as high; a character is half as wide as high.
        width = 2.0 if ascii_only else 1.0
        self._down = min((columns * across - 1) / (2 * POCKET * width), (rows * up - 1) / FIELD.width_m)
        self._right = self._down * width
        self._columns = min(columns, ceil((2 * POCKET * self._right + 1) / across))
        self._rows = min(rows, ceil((FIELD.width_m * self._down + 1) / up))
        self._marks = [[0] * self._columns for _ in range(self._rows)]
        self._things = [[_NOTHING] * self._columns for _ in range(self._rows)]
        self._heading = 0

    def ball(self, world: World) -> None:
        reach = BALL_RADIUS_M + 0.5 / self._right  # half a dot more: a speck must not vanish
        self._fill(world.ball_x_m, world.ball_y_m, reach, 0.0, _BALL, lambda u, v: hypot(u, v) <= reach)

    def robot(self, world: World) -> None:
        x, y, yaw = world.robot_x_m, world.robot_y_m, world.robot_yaw_rad
        self._heading = round(yaw / (tau / 8)) % 8
        self.line(x, y, x + NOSE_M * cos(yaw), y + NOSE_M * sin(yaw), _RAY)
        half = ROBOT_SIDE_M / 2
        self._fill(x, y, half * 2**0.5, yaw, _ROBOT, lambda u, v: max(abs(u), abs(v)) <= half)

    def line(self, x0_m: float, y0_m: float, x1_m: float, y1_m: float, thing: int) -> None:
        steps = ceil(hypot(x1_m - x0_m, y1_m - y0_m) * self._right) or 1
        for step in range(steps + 1):
            share = step / steps
            self.dot(x0_m + share * (x1_m - x0_m), y0_m + share * (y1_m - y0_m), thing)

    def _fill(self, x_m: float, y_m: float, reach_m: float, yaw_rad: float, thing: int, inside: _Inside) -> None:
        """All dots of a body; always the one at its center, which is all that ASCII shows."""
        self.dot(x_m, y_m, thing)
        if self._ascii:
            return
        dot_m = 1.0 / self._right
        reach = ceil(reach_m / dot_m)
        c, s = cos(yaw_rad), sin(yaw_rad)
        column, row = self._place(x_m, y_m)
        for j in range(row - reach, row + reach + 1):
            for i in range(column - reach, column + reach + 1):
                px, py = i * dot_m - POCKET - x_m, HALF_WIDTH - j * dot_m - y_m
                if inside(px * c + py * s, py * c - px * s):
                    self._mark(i, j, thing)

    def dot(self, x_m: float, y_m: float, thing: int) -> None:
        self._mark(*self._place(x_m, y_m), thing)

    def _place(self, x_m: float, y_m: float) -> tuple[int, int]:
        return round((x_m + POCKET) * self._right), round((HALF_WIDTH - y_m) * self._down)

    def _mark(self, i: int, j: int, thing: int) -> None:
        across, up = self._dots
        column, row = i // across, j // up
        if 0 <= column < self._columns and 0 <= row < self._rows:
            if not self._ascii:
                self._marks[row][column] |= _BITS[j % up][i % across]
            self._things[row][column] = max(self._things[row][column], thing)

    def lines(self) -> list[Line]:
        """The picture, with neighbors of one style in one span."""
        made: list[Line] = []
        for marks, things in zip(self._marks, self._things, strict=True):
            line: Line = []
            for mark, thing in zip(marks, things, strict=True):
                text = self._character(mark, thing)
                if line and line[-1][1] == _STYLES[thing]:
                    line[-1] = (line[-1][0] + text, line[-1][1])
                else:
                    line.append((text, _STYLES[thing]))
            made.append(line)
        return made

    def _character(self, mark: int, thing: int) -> str:
        if not self._ascii:
            return chr(_BRAILLE + mark) if mark else " "
        return _HEADINGS[self._heading] if thing == _ROBOT else _ASCII[thing]
