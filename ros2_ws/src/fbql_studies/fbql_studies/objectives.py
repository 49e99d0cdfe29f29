"""The weighted objective against the printed one in play, over more demonstration seeds than the study of trees has.

Both by 50 trials with the behaviors' recipes. Demonstration seeds from FIRST_SEED on are used for nothing else; the run seed
of play is the demonstration seed, so that both meet the same episodes.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path

from fbql.statistics.inference import mean_interval, paired_p_value
from fbql.statistics.tables import Row, finite
from fbql_behaviors.core.evaluation import wheel_rmse
from fbql_behaviors.core.recipes import RECIPES

from fbql_studies import objectives_words
from fbql_studies.leaf_tuning import TEAM_MEASURES
from fbql_studies.runner.study import MOST_PLAYED, MOST_SEEDS, Parameters, Result, Task, check_counts
from fbql_studies.tree_methods import OBJECTIVES, Lesson, induced
from fbql_studies.tree_play import PRESETS, SETTINGS, retuned, score

DESCRIPTION = "the weighted objective against the printed one: held-out error and play over many demonstration seeds"
CAPTIONS: Mapping[str, str] = {}
COLUMNS = objectives_words.COLUMNS
words = objectives_words.tables
FIRST_SEED = 2001
"""The first demonstration seed, and run seed of play."""


def add_options(parser: argparse.ArgumentParser) -> None:
    """Adds the study's own options."""
    parser.add_argument("--seeds", type=int, default=40, metavar="N", help="demonstration seeds (40)")
    parser.add_argument(
        "--episodes", type=int, default=100, metavar="N", help="episodes of each set of trees and thresholds (100)"
    )


def tasks(options: argparse.Namespace) -> list[Task]:
    """A task for each demonstration seed."""
    check_counts(options, seeds=MOST_SEEDS, episodes=MOST_PLAYED)
    seeds = range(FIRST_SEED, FIRST_SEED + options.seeds)
    return [Task(str(seed), {"seed": seed, "episodes": options.episodes}) for seed in seeds]


def run(parameters: Parameters) -> Result:
    """Makes a set of trees with each objective from the same patterns, and plays it with each pair of thresholds."""
    seed, episodes = parameters["seed"], parameters["episodes"]
    lessons = {behavior: Lesson(behavior, seed) for behavior in RECIPES}
    found: Result = {}
    for objective in OBJECTIVES:
        trees = {behavior: induced(lesson, objective, trials=50).tree for behavior, lesson in lessons.items()}
        found[objective] = {
            "rmse_levels": {name: wheel_rmse(tree, lessons[name].held_out) for name, tree in trees.items()},
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
            f"{behavior.replace('_', ' ')}: error [levels]",
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


def figures(_results: Mapping[str, Result], _directory: Path) -> list[Path]:
    """There are none."""
    return []
