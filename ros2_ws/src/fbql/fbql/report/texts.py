"""Texts of reports: what controllers and features mean, and texts from recordings made safe to show.

Whoever made a recording chose the names in it; here they are never markup.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from typing import Any

NOT_AVAILABLE = "n/a"
MAX_CHARACTERS = 400
"""Longer texts are cut off."""
_MAX_ITEMS = 64
_MAX_DEPTH = 3

CONTROLLERS = {
    "subsumption": "One behavior drives alone: the first of the layers that is triggered.",
    "uniform": "All behaviors drive together: the command is the mean of their references.",
    "fbql_literal": "All behaviors drive together: the command is the sum of their references, each times its weight. The "
    "weights belong to the joint state (the leaves of all behaviors) and change by the paper's equations 5 and 6.",
    "fbql": "One behavior drives alone for a while (fbql_hold_s); it is chosen by learned weights, which depend on "
    'the joint state (the leaves of all behaviors) and on what is sensed. "weight" shows the choice: 1 for the behavior that drives. It '
    "learns no Q.",
    "fbql_model": "One behavior drives alone for a while (fbql_model_play_s): the one with the largest learned weight. The weights "
    "depend on the joint state (the leaves of all behaviors) and on what is sensed, and are learned between the episodes, in "
    'imagined ones. "weight" shows the choice: 1 for the behavior that drives. It learns no Q.',
    "fbql_value": "One behavior drives alone for a while (fbql_value_hold_s); it is chosen by weights that follow Q, the "
    "learned value of each behavior, which depends on the joint state (the leaves of all behaviors) and on what is sensed. "
    '"weight" shows the choice: 1 for the behavior that drives.',
}
"""What a controller does, for a reader who only knows the paper; by the name in a decision."""

FEATURES = {
    "ball_distance": "how far the ball is away",
    "ball_bearing": "on which side of the robot the ball is; 0 is straight ahead",
    "wall_distance": "how far the closest point of the walls is away",
    "wall_bearing": "on which side of the robot that point is",
    "detour_heading_error": "on which side of the robot the way round the ball is (in the rules: the detour): straight at the "
    "ball when that pushes it at the goal, else past it on the side that leads behind it",
    "approach_angle": "how far the line from the ball to the goal (in the rules: the ball-to-goal line) turns from the line "
    "from the robot to the ball; 0 means that driving at the ball pushes it at the goal",
}
"""What a feature of our behaviors means; by the name in a tree."""


def plain(text: object) -> str:
    """A text without control characters and changes of writing direction, and not too long to show."""
    shown = "".join(character if character.isprintable() else " " for character in str(text)[: MAX_CHARACTERS + 1])
    return shown if len(shown) <= MAX_CHARACTERS else f"{shown[:MAX_CHARACTERS]} ..."


def html(text: object) -> str:
    """A text escaped for HTML, between tags or in an attribute."""
    return escape(plain(text))


def value_text(value: object, depth: int = 0) -> str:
    """A value of a parameter as a text, cut to a few items and levels: YAML can nest without limit."""
    if value is None:
        return NOT_AVAILABLE
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, Mapping):
        items = [f"{plain(name)}: {value_text(each, depth + 1)}" for name, each in _first(value.items(), depth)]
        return f"{{{', '.join(items)}}}" if depth < _MAX_DEPTH else "{...}"
    if isinstance(value, list | tuple | set):
        items = [value_text(each, depth + 1) for each in _first(value, depth)]
        return ", ".join(items) if depth == 0 else f"[{', '.join(items)}]" if depth < _MAX_DEPTH else "[...]"
    return plain(value)


def _first(items: Iterable[Any], depth: int) -> list[Any]:
    return [] if depth >= _MAX_DEPTH else [item for item, _ in zip(items, range(_MAX_ITEMS), strict=False)]


def json_for_html(value: object) -> str:
    """JSON for a script element: nothing in it can end the element, or begin a comment."""
    text = json.dumps(value, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def table(caption: str, head: Sequence[str], rows: Iterable[Sequence[str]], numbers: Sequence[int] = ()) -> str:
    """An HTML table; its cells are HTML already. `numbers` are the columns that hold numbers."""

    def cells(tag: str, row: Sequence[str], extra: str = "") -> str:
        kind = [' class="number"' if index in numbers else "" for index in range(len(row))]
        return "".join(f"<{tag}{extra}{each}>{cell}</{tag}>" for each, cell in zip(kind, row, strict=True))

    body = "\n".join(f"<tr>{cells('td', row)}</tr>" for row in rows)
    header = cells("th", head, ' scope="col"')
    return f"<table><caption>{caption}</caption>\n<thead><tr>{header}</tr></thead>\n<tbody>\n{body}\n</tbody></table>"
