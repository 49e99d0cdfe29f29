"""The table of the study of objectives as Markdown, for docs/trees.md; a test compares it with the committed data."""

from __future__ import annotations

from collections.abc import Sequence

from studies.study import Row
from studies.tree_words import markdown, number


def tables(rows: Sequence[Row]) -> dict[str, str]:
    """Title -> table."""
    head = ["thresholds", "measure", "weighted", "printed", "printed - weighted (95 %)", "p"]
    body = [
        [
            row["where"],
            row["measure"],
            number(row["weighted"], ".4g"),
            number(row["printed"], ".4g"),
            f"{row['difference']:+.3g} ({row['low']:+.3g} to {row['high']:+.3g})",
            number(row["p"], ".2g"),
        ]
        for row in rows
    ]
    return {"the two objectives": markdown(head, body)}
