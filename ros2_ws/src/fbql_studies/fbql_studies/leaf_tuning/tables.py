"""The tables of the study of leaf tuning: before and after, paired by tuning seed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from fbql.statistics.tables import Row, Table, between, number, tabulate
from fbql_behaviors.core.exercises import EXERCISES

from fbql_studies.common.team_play import PAIRED_COLUMNS, TEAM_MEASURES, paired_difference, spoken
from fbql_studies.runner.study import Result

SHIPPED, PRINTED, FRESH = "shipped", "printed objective", "fresh demonstrations"
BEFORE, ALL = "none", "all"
"""Which behaviors of a team are tuned."""
ALONE = "alone"
FIRST = ("success rate", "cost per goal", "contact steps per episode")
"""A team's main measures; the others have their own table."""

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
    **PAIRED_COLUMNS,
}
"""Column -> its meaning."""


def words(rows: Sequence[Row]) -> dict[str, Table]:
    """Title -> table."""
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
    return tabulate(
        rows,
        {
            "trees": lambda row: row["trees"],
            what: lambda row: ", ".join(spoken(row[column]).removeprefix("team, ") for column in columns),
            "measure": lambda row: row["measure"],
            "before": lambda row: number(row["before"], ".4g"),
            "after": lambda row: number(row["after"], ".4g"),
            "change [%]": lambda row: number(row["percent"], "+.1f"),
            "difference (95 %)": lambda row: between(row, "difference", "low", "high", "+.3g"),
            "p": lambda row: number(row["p"], ".2g"),
        },
    )


def table(results: Mapping[str, Result]) -> list[Row]:
    """A row for each measure: before, after, and their difference with its 95 % interval and p over tuning seeds."""
    rows: list[Row] = []
    for trees in (SHIPPED, PRINTED, FRESH):
        chosen = [result for result in results.values() if result["trees"] == trees]
        if chosen:
            rows += _behavior_rows(trees, [result["behaviors"] for result in chosen])
            rows += _team_rows(trees, [result["teams"] for result in chosen])
    return rows


def _behavior_rows(trees: str, found: Sequence[Mapping[str, Any]]) -> list[Row]:
    return [
        _row(
            (trees, name, "alone", measure_name),
            [each[name]["before"][measure_name] for each in found],
            [each[name]["after"][measure_name] for each in found],
        )
        for name in EXERCISES
        for measure_name in sorted(found[0][name]["before"], key=lambda each: (each != EXERCISES[name].measure, each))
    ]


def _team_rows(trees: str, found: Sequence[Sequence[Mapping[str, Any]]]) -> list[Row]:
    by_team = {
        (team["preset"], team["tuned"]): [
            next(other for other in each if (other["preset"], other["tuned"]) == (team["preset"], team["tuned"]))
            for each in found
        ]
        for team in found[0]
    }
    return [
        _row(
            (trees, tuned, f"team, {preset}", name),
            [of(team) for team in by_team[preset, BEFORE]],
            [of(team) for team in played],
        )
        for (preset, tuned), played in by_team.items()
        if tuned != BEFORE
        for name, of in TEAM_MEASURES.items()
    ]


def _row(what: tuple[str, str, str, str], before: Sequence[float], after: Sequence[float]) -> Row:
    trees, tuned, played, name = what
    mean_before = sum(before) / len(before)
    paired = paired_difference(after, before)
    return {
        "trees": trees,
        "tuned": tuned,
        "played": played,
        "measure": name,
        "n": len(before),
        "before": mean_before,
        "after": sum(after) / len(after),
        "percent": 100 * paired["difference"] / mean_before if mean_before else None,
        **paired,
    }
