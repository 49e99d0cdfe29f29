"""Rungs of the ladder: the required value, the value found, and whether it suffices."""

from __future__ import annotations

from collections.abc import Sequence

from fbql.statistics.tables import Row, Table, number, tabulate

RUNG_COLUMNS = {
    "rung": "rung of the ladder, and whose",
    "measure": "what is measured",
    "bound": "whether `wanted` is an upper or a lower limit",
    "wanted": "the limit set beforehand; for collisions, the control's value",
    "found": "the value found",
    "reached": "whether it keeps to the limit",
}


def rung_row(rung: str, measure: str, found: float, wanted: float, at_least: bool = False) -> Row:
    """A measure of a rung."""
    reached = found >= wanted if at_least else found <= wanted
    return {"rung": rung, "measure": measure, "bound": "at least" if at_least else "at most", "wanted": wanted,
            "found": found, "reached": reached}  # fmt: skip


def rungs_table(rows: Sequence[Row]) -> Table:
    """The rungs among the rows."""
    return tabulate(
        (row for row in rows if "rung" in row),
        {
            "rung": lambda row: row["rung"],
            "measure": lambda row: row["measure"],
            "wanted": lambda row: f"{row['bound']} {number(row['wanted'], '.3g')}",
            "found": lambda row: number(row["found"], ".3g"),
            "reached": lambda row: "yes" if row["reached"] else "**no**",
        },
    )
