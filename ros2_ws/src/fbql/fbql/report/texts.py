"""Texts from a recording, made safe to show. Whoever made the recording chose its names; they are never markup here."""

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


def plain(text: object) -> str:
    """A text without control characters or such as turn the direction of writing, and not too long to show."""
    shown = "".join(character if character.isprintable() else " " for character in str(text)[: MAX_CHARACTERS + 1])
    return shown if len(shown) <= MAX_CHARACTERS else f"{shown[:MAX_CHARACTERS]} ..."


def html(text: object) -> str:
    """A text as it may stand in HTML, between tags or in an attribute."""
    return escape(plain(text))


def value_text(value: object, depth: int = 0) -> str:
    """A value of a parameter as a text. Only so much of it is shown as there is room for: YAML can nest without end."""
    if value is None:
        return NOT_AVAILABLE
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, Mapping):
        items = [f"{plain(name)}: {value_text(each, depth + 1)}" for name, each in _some(value.items(), depth)]
        return f"{{{', '.join(items)}}}" if depth < _MAX_DEPTH else "{...}"
    if isinstance(value, list | tuple | set):
        items = [value_text(each, depth + 1) for each in _some(value, depth)]
        return ", ".join(items) if depth == 0 else f"[{', '.join(items)}]" if depth < _MAX_DEPTH else "[...]"
    return plain(value)


def _some(items: Iterable[Any], depth: int) -> list[Any]:
    return [] if depth >= _MAX_DEPTH else [item for item, _ in zip(items, range(_MAX_ITEMS), strict=False)]


def json_for_html(value: object) -> str:
    """JSON as it may stand inside of a script element: nothing in it can end that, or begin a comment."""
    text = json.dumps(value, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def table(caption: str, head: Sequence[str], rows: Iterable[Sequence[str]], numbers: Sequence[int] = ()) -> str:
    """An HTML table of cells that are HTML already. `numbers` are the columns that hold numbers."""

    def cells(tag: str, row: Sequence[str], extra: str = "") -> str:
        kind = [' class="number"' if index in numbers else "" for index in range(len(row))]
        return "".join(f"<{tag}{extra}{each}>{cell}</{tag}>" for each, cell in zip(kind, row, strict=True))

    body = "\n".join(f"<tr>{cells('td', row)}</tr>" for row in rows)
    header = cells("th", head, ' scope="col"')
    return f"<table><caption>{caption}</caption>\n<thead><tr>{header}</tr></thead>\n<tbody>\n{body}\n</tbody></table>"
