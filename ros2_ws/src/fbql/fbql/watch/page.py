"""The contents of a screen, as lines of characters: the field on the left, text beside it, text below, a message last."""

from __future__ import annotations

from collections.abc import Sequence
from textwrap import wrap

from fbql_common.core.types import World
from fbql_common.terminal.screen import Line

from fbql.watch.picture import Trail, field_picture

PICTURE_S = 1 / 20
"""Time between two pages [s]."""
SIDE_COLUMNS = 32
LEAST_COLUMNS, LEAST_ROWS = 66, 23
"""Smaller than this there is no room for the picture beside the text."""
STRONG, QUIET = "1", "2"


def page(
    world: World | None,
    side: Sequence[Line],
    message: str,
    columns: int,
    rows: int,
    ascii_only: bool,
    below: Sequence[Line] = (),
    trail: Trail = Trail(),  # noqa: B008 - immutable
) -> list[Line]:
    """The lines of a screen of `columns` x `rows` characters, none of them longer; `world` is None before the first.

    Args:
        side: the lines beside the picture.
        message: the last line.
        below: the lines between the picture and the message.
        trail: where robot and ball have been.
    """
    if columns < LEAST_COLUMNS or rows < LEAST_ROWS:
        text = f"This terminal is {columns} x {rows}; at least {LEAST_COLUMNS} x {LEAST_ROWS} is needed."
        return [[(part, "")] for part in wrap(text, max(columns, 1))[:rows]]
    width, height = columns - SIDE_COLUMNS - 1, rows - 1 - len(below)
    picture = [] if world is None else field_picture(world, width, height, ascii_only, trail)
    lines: list[Line] = []
    for row in range(height):
        left: Line = picture[row] if row < len(picture) else []
        right: Line = list(side[row]) if row < len(side) else []
        gap = width + 1 - sum(len(text) for text, _ in left)
        lines.append([*left, (" " * gap, ""), *cut(right, SIDE_COLUMNS)] if right else list(left))
    return [*lines, *(cut(line, columns - 1) for line in below), [(message[: columns - 1], STRONG)]]


def named(name: str, text: str) -> Line:
    """A line beside the picture: a name at its left end, a value at its right end."""
    return [(name + " " + text.rjust(SIDE_COLUMNS - len(name) - 1), "")]


def cut(line: Line, columns: int) -> Line:
    """A line without what is beyond the last column."""
    kept: Line = []
    for text, style in line:
        kept.append((text[:columns], style))
        columns -= len(text)
        if columns <= 0:
            break
    return kept
