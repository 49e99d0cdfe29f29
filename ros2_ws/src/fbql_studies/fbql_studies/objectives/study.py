"""The weighted objective against the printed one in play, over more demonstration seeds than the study of trees.

Both by 50 trials with the behaviors' recipes. Demonstration seeds from FIRST_SEED on are used for nothing else; the run seed
of play is the demonstration seed, so that both meet the same episodes.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path

from fbql.statistics.inference import mean_interval, paired_p_value
from fbql.statistics.tables import Row, Table, between, finite, number
from fbql_behaviors.core.evaluation import wheel_rmse
from fbql_behaviors.core.recipes import RECIPES

from fbql_studies.common.pattern_sets import OBJECTIVES, PatternSet, induced
from fbql_studies.common.team_play import PRESETS, SETTINGS, TEAM_MEASURES, retuned, score, spoken
from fbql_studies.runner.study import MOST_PLAYED, MOST_SEEDS, Parameters, Result, Task, add_count, check_counts

DESCRIPTION = "the weighted objective against the printed one: held-out error and play over many demonstration seeds"
CAPTIONS: Mapping[str, str] = {}
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
FIRST_SEED = 2001
"""The first demonstration seed, which is the run seed of play as well."""


def add_options(parser: argparse.ArgumentParser) -> None:
    """Adds the study's own options."""
    add_count(parser, "--seeds", 40, "demonstration seeds")
    add_count(parser, "--episodes", 100, "episodes of each set of trees and thresholds")


def tasks(options: argparse.Namespace) -> list[Task]:
    """A task for each demonstration seed."""
    check_counts(options, seeds=MOST_SEEDS, episodes=MOST_PLAYED)
    seeds = range(FIRST_SEED, FIRST_SEED + options.seeds)
    return [Task(str(seed), {"seed": seed, "episodes": options.episodes}) for seed in seeds]


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
    difference = mean_interval([theirs - ours for ours, theirs in zip(weighted, printed, strict=True)])
    row = {
        "where": where,
        "measure": measure,
        "n": len(weighted),
        "weighted": sum(weighted) / len(weighted),
        "printed": sum(printed) / len(printed),
        "difference": difference.estimate,
        "low": difference.low,
        "high": difference.high,
        "p": paired_p_value(printed, weighted),
    }
    return finite(row)


def words(rows: Sequence[Row]) -> dict[str, Table]:
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


def figures(_results: Mapping[str, Result], _directory: Path) -> list[Path]:
    """There are none."""
    return []
