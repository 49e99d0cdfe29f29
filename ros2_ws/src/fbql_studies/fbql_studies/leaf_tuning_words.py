"""The tables of the study of leaf tuning for docs/trees.md; a test compares them with the committed data."""

from __future__ import annotations

from collections.abc import Sequence

from fbql.statistics.tables import Row, Table, between, number

from fbql_studies.tree_words import spoken

ALONE = "alone"
FIRST = ("success rate", "cost per goal", "contact steps per episode")
"""Measures of a team that are told of first; the others stand in a table of their own."""

COLUMNS = {
    "trees": "which trees were tuned",
    "tuned": "whose leaves were",
    "played": "alone, or in a team with these thresholds",
    "measure": "what was measured",
    "n": "how many tuning seeds",
    "before": "mean before tuning",
    "after": "mean after it",
    "percent": "the difference in percent of `before`",
    "difference": "after - before, paired by seed",
    "low": "the lower end of its 95 % interval, a bootstrap over the seeds; null with one",
    "high": "the upper end; null with one",
    "p": "p of the sign-flip test, paired by seed, that there is no difference; null with one",
}
"""Column -> what it says."""


def tables(rows: Sequence[Row]) -> dict[str, Table]:
    """Title -> table, in the order of docs/trees.md."""
    alone = [row for row in rows if row["played"] == ALONE]
    teams = [row for row in rows if row["played"] != ALONE]
    whole = [row for row in teams if row["tuned"] == "all"]
    singles = [row for row in teams if row["tuned"] != "all" and row["measure"] in FIRST]
    return {
        "each behavior alone": _table("behavior", alone, ("tuned",)),
        "the whole team": _table("thresholds", [row for row in whole if row["measure"] in FIRST], ("played",)),
        "the whole team, other measures": _table(
            "thresholds", [row for row in whole if row["measure"] not in FIRST], ("played",)
        ),
        "the team with one tuned behavior": _table("thresholds, tuned", singles, ("played", "tuned")),
    }


def _table(what: str, rows: Sequence[Row], columns: Sequence[str]) -> Table:
    head = ["trees", what, "measure", "before", "after", "change [%]", "difference (95 %)", "p"]
    body = [
        [
            row["trees"],
            ", ".join(spoken(row[column]).removeprefix("team, ") for column in columns),
            row["measure"],
            number(row["before"], ".4g"),
            number(row["after"], ".4g"),
            number(row["percent"], "+.1f"),
            between(row, "difference", "low", "high", "+.3g"),
            number(row["p"], ".2g"),
        ]
        for row in rows
    ]
    return Table(head, body)
