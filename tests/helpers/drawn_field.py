"""World states to draw, and what is drawn as plain text."""

from __future__ import annotations

from fbql_common.core.types import World
from fbql_common.core.walls import closest_wall_point
from fbql_common.terminal.screen import Line, text_of


def world_with(x: float = 0.0, y: float = 0.0, yaw: float = 0.0, ball: tuple[float, float] = (0.55, 0.6)) -> World:
    wall = closest_wall_point(x, y)
    return World(1, 0, 0, x, y, yaw, 0.0, 0.0, *ball, 0.0, 0.0, *wall, False, False, False, False, False, False)


def plain(lines: list[Line]) -> list[str]:
    return [text_of(line, colour=False) for line in lines]
