"""Tables that people read: a head and a body of text cells, as Markdown for pages and as aligned text for a terminal."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import groupby
from math import isfinite
from shutil import get_terminal_size
from typing import Any, NamedTuple

Row = dict[str, Any]

_GAP = "  "
_NONE = "n/a"


class Table(NamedTuple):
    """A table of text cells."""

    head: Sequence[str]
    body: Sequence[Sequence[str]]


def tabulate(rows: Iterable[Row], columns: Mapping[str, Callable[[Row], str]]) -> Table:
    """A table with a line for each row; `columns` maps each column's head to the function that writes its cells."""
    return Table(list(columns), [[write(row) for write in columns.values()] for row in rows])


def as_markdown(table: Table) -> str:
    """The table in Markdown."""
    lines = [table.head, ["---"] * len(table.head), *table.body]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def as_text(table: Table, width: int | None = None) -> str:
    """The table with aligned columns: numbers to the right, words to the left, without emphasis.

    Args:
        width: characters of a line; the terminal's width unless given. The columns that don't fit follow below, with the
            first one repeated and at least one beside it.
    """
    width = width or get_terminal_size((160, 0)).columns
    cells = [[cell.replace("**", "") for cell in row] for row in (table.head, *table.body)]
    columns = list(zip(*cells, strict=True))
    widths = [max(map(len, column)) for column in columns]
    align = [str.ljust if _has_words(column[1:]) else str.rjust for column in columns]
    parts: list[list[int]] = [[]]
    for i in range(1, len(widths)):
        if parts[-1] and sum(len(_GAP) + widths[j] for j in (*parts[-1], i)) + widths[0] > width:
            parts.append([])
        parts[-1].append(i)
    return "\n\n".join(
        "\n".join(_GAP.join(align[i](row[i], widths[i]) for i in (0, *part)).rstrip() for row in cells)
        for part in parts
    )


def _has_words(column: Sequence[str]) -> bool:
    """Whether a cell does not begin like a number."""
    return any(cell[0] not in "+-.0123456789" for cell in column if cell and cell != _NONE)


def rows_as_text(rows: Sequence[Row], width: int | None = None) -> str:
    """Rows as tables with aligned columns; a row with other columns begins a new table."""
    parts = [(list(columns), list(part)) for columns, part in groupby(rows, key=tuple)]
    told = [Table(columns, [[_cell(row[name]) for name in columns] for row in part]) for columns, part in parts]
    return "\n\n".join(as_text(each, width) for each in told) or "no results"


def _cell(value: object) -> str:
    if value is None:
        return _NONE
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def between(row: Row, middle: str, low: str, high: str, form: str, scale: float = 1.0) -> str:
    """An estimate with its interval, from the columns named: no interval without a low end, ∞ without a high one."""
    words = number(row[middle], form, scale)
    if words and row[low] is not None:
        words += f" ({number(row[low], form, scale)} to {number(row[high], form, scale) or '∞'})"
    return words


def number(value: float | None, form: str, scale: float = 1.0) -> str:
    """A number in a format; empty where there is none."""
    return "" if value is None else f"{value * scale:{form}}"


def mean_of(values: Sequence[float]) -> float | None:
    """The mean; None where there are no values."""
    return sum(values) / len(values) if values else None


def with_all_columns(rows: Iterable[Row]) -> list[Row]:
    """The rows, each with every column that one of them has: None where a row had none."""
    kept = list(rows)
    columns = {name: None for row in kept for name in row}
    return [{**columns, **row} for row in kept]


def finite(row: Row) -> Row:
    """The row with None for numbers that are not finite, which JSON doesn't have."""
    return {key: None if isinstance(value, float) and not isfinite(value) else value for key, value in row.items()}
