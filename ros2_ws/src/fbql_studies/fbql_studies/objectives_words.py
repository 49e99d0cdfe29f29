"""The table of the study of objectives for docs/trees.md; a test compares it with the committed data."""

from __future__ import annotations

from collections.abc import Sequence

from fbql.statistics.tables import Row, Table, between, number

COLUMNS = {
    "where": "held out: on demonstrations; else the thresholds of the Subsumption that the trees were played with",
    "measure": "what was measured",
    "n": "how many demonstration seeds",
    "weighted": "mean over the trees of the weighted objective",
    "printed": "mean over those of the printed one",
    "difference": "printed - weighted, paired by seed",
    "low": "the lower end of its 95 % interval, a bootstrap over the seeds; null with one",
    "high": "the upper end; null with one",
    "p": "p of the sign-flip test, paired by seed, that there is no difference; null with one",
}
"""Column -> what it says."""


def tables(rows: Sequence[Row]) -> dict[str, Table]:
    """Title -> table."""
    head = ["thresholds", "measure", "weighted", "printed", "printed - weighted (95 %)", "p"]
    body = [
        [
            row["where"],
            row["measure"],
            number(row["weighted"], ".4g"),
            number(row["printed"], ".4g"),
            between(row, "difference", "low", "high", "+.3g"),
            number(row["p"], ".2g"),
        ]
        for row in rows
    ]
    return {"the two objectives": Table(head, body)}
