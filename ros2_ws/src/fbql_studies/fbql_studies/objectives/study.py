"""The weighted objective against the printed one in play, over more demonstration seeds than the study of trees.

Both by 50 trials with the behaviors' recipes. Demonstration seeds from FIRST_SEED on are used for nothing else; the run seed
of play is the demonstration seed, so that both meet the same episodes.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path

from fbql.statistics.tables import Row, Table, between, number, tabulate
from fbql_behaviors.core.evaluation import wheel_rmse
from fbql_behaviors.core.recipes import RECIPES

from fbql_studies.common.pattern_sets import OBJECTIVES, PatternSet, induced
from fbql_studies.common.team_play import (
    PAIRED_COLUMNS,
    PRESETS,
    SETTINGS,
    TEAM_MEASURES,
    paired_difference,
    retuned,
    score,
    spoken,
)
from fbql_studies.runner.study import MOST_PLAYED, MOST_SEEDS, Parameters, Result, StudyTask, add_count, check_counts

DESCRIPTION = "the weighted objective against the printed one: held-out error and play over many demonstration seeds"
CAPTIONS: Mapping[str, str] = {}
COLUMNS = {
    "where": "held out: on demonstrations; else the thresholds of the Subsumption that the trees were played with",
    "measure": "what was measured",
    "n": "how many demonstration seeds",
    "weighted": "mean over the trees of the weighted objective",
    "printed": "mean over those of the printed one",
    "difference": "printed - weighted, paired by seed",
    **PAIRED_COLUMNS,
}
FIRST_SEED = 2001
"""The first demonstration seed, which is the run seed of play as well."""


def add_options(parser: argparse.ArgumentParser) -> None:
    """Adds the study's own options."""
    add_count(parser, "--seeds", 40, "demonstration seeds")
    add_count(parser, "--episodes", 100, "episodes of each set of trees and thresholds")


def tasks(options: argparse.Namespace) -> list[StudyTask]:
    """A task for each demonstration seed."""
    check_counts(options, seeds=MOST_SEEDS, episodes=MOST_PLAYED)
    seeds = range(FIRST_SEED, FIRST_SEED + options.seeds)
    return [StudyTask(str(seed), {"seed": seed, "episodes": options.episodes}) for seed in seeds]


def run(parameters: Parameters) -> Result:
    """Makes a set of trees with each objective from the same patterns, and plays it with each pair of thresholds."""
    seed, episodes = parameters["seed"], parameters["episodes"]
    sets = {behavior: PatternSet(behavior, seed) for behavior in RECIPES}
    found: Result = {}
    for objective in OBJECTIVES:
        trees = {behavior: induced(patterns, objective, trials=50).tree for behavior, patterns in sets.items()}
        found[objective] = {
            "rmse_levels": {name: wheel_rmse(tree, sets[name].held_out) for name, tree in trees.items()},
            "play": {
                name: score(trees, PRESETS.get(name) or retuned(trees), seed, episodes)._asdict() for name in SETTINGS
            },
        }
    return found


def table(results: Mapping[str, Result]) -> list[Row]:
    """A row for each measure: both objectives, and printed less weighted with its 95 % interval and p over the seeds."""
    if not results:
        return []
    weighted, printed = ([result[objective] for result in results.values()] for objective in ("weighted", "printed"))
    rows = [
        _row(
            "held out",
            f"{spoken(behavior)}: error [levels]",
            [each["rmse_levels"][behavior] for each in weighted],
            [each["rmse_levels"][behavior] for each in printed],
        )
        for behavior in RECIPES
    ]
    for name in SETTINGS:
        for measure, of in TEAM_MEASURES.items():
            rows.append(
                _row(
                    name,
                    measure,
                    [of(each["play"][name]) for each in weighted],
                    [of(each["play"][name]) for each in printed],
                )
            )
    return rows


def _row(where: str, measure: str, weighted: list[float], printed: list[float]) -> Row:
    means = {"weighted": sum(weighted) / len(weighted), "printed": sum(printed) / len(printed)}
    return {"where": where, "measure": measure, "n": len(weighted), **means, **paired_difference(printed, weighted)}


def words(rows: Sequence[Row]) -> dict[str, Table]:
    """Title -> table."""
    return {
        "the two objectives": tabulate(
            rows,
            {
                "thresholds": lambda row: row["where"],
                "measure": lambda row: row["measure"],
                "weighted": lambda row: number(row["weighted"], ".4g"),
                "printed": lambda row: number(row["printed"], ".4g"),
                "printed - weighted (95 %)": lambda row: between(row, "difference", "low", "high", "+.3g"),
                "p": lambda row: number(row["p"], ".2g"),
            },
        )
    }


def figures(_results: Mapping[str, Result], _directory: Path) -> list[Path]:
    """This study has none."""
    return []
