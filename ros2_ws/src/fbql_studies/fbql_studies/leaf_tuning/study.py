"""Leaf tuning, before and after: every behavior by its own measure, and the whole team, from the same starts.

A task tunes the three trees of a set with one tuning seed. Tuning seeds are below 1000; measurements use
seeds from FIRST_MEASURING_SEED on, others for each tuning seed, so that the pairs of a table are independent. The
settings of tuning were chosen on the shipped trees and on tuning seeds below FIRST_TUNING_SEED.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from fbql.demonstrations.instruct import instruct
from fbql.demonstrations.make_tree import DEMONSTRATION_SEED, INDUCTION_SEED
from fbql.demonstrations.practice import PracticeGround, measure, measuring_seeds
from fbql.statistics.tables import Row
from fbql_behaviors.core.exercises import Attempt, exercise_of, mean_cost
from fbql_behaviors.core.induction import induce
from fbql_behaviors.core.leaf_tuning import tune, tuning_of
from fbql_behaviors.core.observation import OBSERVATIONS
from fbql_behaviors.core.patterns import patterns_of
from fbql_behaviors.core.recipes import RECIPES
from fbql_behaviors.core.tree import Tree
from fbql_fusion.core.tasks.soccer.subsumption import PRESETS, Thresholds

from fbql_studies.common.team_play import RETUNED, retuned, score
from fbql_studies.leaf_tuning import tables
from fbql_studies.leaf_tuning.tables import ALL, BEFORE, FRESH, PRINTED, SHIPPED
from fbql_studies.runner.study import MOST_PLAYED, MOST_SEEDS, Parameters, Result, StudyTask, add_count, check_counts

DESCRIPTION = "leaf tuning: each behavior and the team before and after, from the same starts"
CAPTIONS: Mapping[str, str] = {}
COLUMNS, table, words = tables.COLUMNS, tables.table, tables.words
FIRST_TUNING_SEED = 101
FIRST_MEASURING_SEED = 10_000
"""Added to a tuning seed to get the seed of the measurements and the matches."""
FRESH_DEMONSTRATIONS = 1001
"""First demonstration seed of the trees that no setting was chosen on."""


def add_options(parser: argparse.ArgumentParser) -> None:
    """Adds the study's own options."""
    add_count(parser, "--seeds", 8, "tuning seeds of each kind of trees")
    add_count(parser, "--starts", 200, "starts that a behavior is measured on")
    add_count(parser, "--episodes", 200, "episodes of each team and preset")


def tasks(options: argparse.Namespace) -> list[StudyTask]:
    """A task for each kind of trees and tuning seed; fresh demonstrations are others for each."""
    check_counts(options, seeds=MOST_SEEDS, starts=MOST_PLAYED, episodes=MOST_PLAYED)
    return [
        StudyTask(
            f"{trees.split()[0]}-{FIRST_TUNING_SEED + index}",
            {
                "trees": trees,
                "demonstration_seed": FRESH_DEMONSTRATIONS + index if trees == FRESH else DEMONSTRATION_SEED,
                "tuning_seed": FIRST_TUNING_SEED + index,
                "starts": options.starts,
                "episodes": options.episodes,
            },
        )
        for trees in (SHIPPED, PRINTED, FRESH)
        for index in range(options.seeds)
    ]


def run(parameters: Parameters) -> Result:
    """Tunes a set of trees; measures its behaviors alone, and teams in which all or one of them are tuned."""
    seed = parameters["tuning_seed"]
    measuring_seed = FIRST_MEASURING_SEED + seed
    before = {name: _tree(name, parameters["trees"], parameters["demonstration_seed"]) for name in RECIPES}
    after: dict[str, Tree] = {}
    behaviors: dict[str, Any] = {}
    for name, tree in before.items():
        exercise, ground = exercise_of(name), PracticeGround(name)
        tuned = tune(tree, exercise, ground, ground.dt_s, tuning_of(name), seed)
        after[name] = tuned.tree
        starts = measuring_seeds(measuring_seed, parameters["starts"])
        behaviors[name] = {
            "leaves": tree.leaf_count,
            "leaves_changed": tuned.leaves_changed,
            "before": _figures(name, measure(tree, exercise, ground, starts)),
            "after": _figures(name, measure(tuned.tree, exercise, ground, starts)),
        }
    singly = {name: {**before, name: after[name]} for name in before}
    teams: list[Row] = []

    def play(trees: Mapping[str, Tree], tuned: str, preset: str, thresholds: Thresholds) -> None:
        counted = score(trees, thresholds, measuring_seed, parameters["episodes"])._asdict()
        teams.append({"tuned": tuned, "preset": preset, "thresholds": list(thresholds), **counted})

    for preset, thresholds in PRESETS.items():
        play(before, BEFORE, preset, thresholds)
        play(after, ALL, preset, thresholds)
        for name, trees in singly.items():
            play(trees, name, preset, thresholds)
    play(before, BEFORE, RETUNED, retuned(before))
    play(after, ALL, RETUNED, retuned(after))
    return {"trees": parameters["trees"], "tuning_seed": seed, "behaviors": behaviors, "teams": teams}


def _tree(behavior: str, trees: str, demonstration_seed: int) -> Tree:
    recipe = RECIPES[behavior]
    demonstrations = instruct(behavior, demonstration_seed, recipe.demonstrations, recipe.steps)
    patterns = patterns_of(demonstrations, OBSERVATIONS[behavior], recipe.every, recipe.patterns)
    return induce(behavior, patterns, recipe.printed if trees == PRINTED else recipe.induction, INDUCTION_SEED).tree


def _figures(behavior: str, episodes: Sequence[Attempt]) -> dict[str, float]:
    """What is measured of a behavior's tree: name -> mean over starts, or over steps."""
    steps = sum(episode.steps for episode in episodes)
    exercise = exercise_of(behavior)
    seconds = steps * PracticeGround(behavior).dt_s
    return {
        exercise.measure: mean_cost(episodes, exercise),
        "m/s": sum(episode.travelled_m for episode in episodes) / seconds,
        "collisions begun per 1000 steps": 1000 * sum(episode.collisions_begun for episode in episodes) / steps,
    }


def figures(_results: Mapping[str, Result], _directory: Path) -> list[Path]:
    """This study has none."""
    return []
