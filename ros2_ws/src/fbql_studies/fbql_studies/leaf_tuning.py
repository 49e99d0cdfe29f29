"""Leaf tuning before and after: every behavior by its own measure, and the whole team, on the same starts.

A task tunes the three trees of a set with one tuning seed. Tuning seeds are below 1000; what is measured is measured on
seeds from FIRST_MEASURING_SEED on, other ones for each tuning seed, so that the pairs of a table are independent. The
settings of tuning were chosen on the trees that ship and on tuning seeds below FIRST_TUNING_SEED.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from fbql.demonstrations.instruct import instruct
from fbql.demonstrations.make_tree import DEMONSTRATION_SEED, INDUCTION_SEED
from fbql.demonstrations.practice import PracticeGround, measure, measuring_seeds
from fbql.statistics.inference import mean_interval, paired_p_value
from fbql.statistics.tables import Row, finite
from fbql_behaviors.core.exercises import EXERCISES, Episode, exercise_of, measured
from fbql_behaviors.core.induction import induce
from fbql_behaviors.core.leaf_tuning import tune, tuning_of
from fbql_behaviors.core.observation import OBSERVATIONS
from fbql_behaviors.core.patterns import patterns_of
from fbql_behaviors.core.recipes import RECIPES
from fbql_behaviors.core.tree import Tree
from fbql_fusion.core.parameters import PRESETS, Thresholds

from fbql_studies import leaf_tuning_words
from fbql_studies.runner.study import MOST_PLAYED, MOST_SEEDS, Parameters, Result, Task, check_counts
from fbql_studies.tree_play import RETUNED, retuned, score

DESCRIPTION = "leaf tuning: each behavior and the team before and after, from the same starts"
CAPTIONS: Mapping[str, str] = {}
COLUMNS = leaf_tuning_words.COLUMNS
words = leaf_tuning_words.tables
FIRST_TUNING_SEED = 101
FIRST_MEASURING_SEED = 10_000
"""What is added to a tuning seed for the seed of measuring and of the matches."""
FRESH_DEMONSTRATIONS = 1001
"""First demonstration seed of the trees that no setting was chosen on."""
SHIPPED, PRINTED, FRESH = "shipped", "printed objective", "fresh demonstrations"
BEFORE, ALL = "none", "all"
"""Which behaviors of a team are tuned."""


def add_options(parser: argparse.ArgumentParser) -> None:
    """Adds the study's own options."""
    parser.add_argument("--seeds", type=int, default=8, metavar="N", help="tuning seeds of each kind of trees (8)")
    parser.add_argument(
        "--starts", type=int, default=200, metavar="N", help="starts that a behavior is measured on (200)"
    )
    parser.add_argument("--episodes", type=int, default=200, metavar="N", help="episodes of each team and preset (200)")


def tasks(options: argparse.Namespace) -> list[Task]:
    """A task for each kind of trees and tuning seed; fresh demonstrations are others for each."""
    check_counts(options, seeds=MOST_SEEDS, starts=MOST_PLAYED, episodes=MOST_PLAYED)
    return [
        Task(
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


def _figures(behavior: str, episodes: Sequence[Episode]) -> dict[str, float]:
    """What is measured of a behavior's tree: name -> mean over starts, or over steps."""
    steps = sum(episode.steps for episode in episodes)
    exercise = exercise_of(behavior)
    seconds = steps * PracticeGround(behavior).dt_s
    return {
        exercise.measure: measured(episodes, exercise),
        "m/s": sum(episode.travelled_m for episode in episodes) / seconds,
        "collisions begun per 1000 steps": 1000 * sum(episode.collisions_begun for episode in episodes) / steps,
    }


TEAM_MEASURES: dict[str, Callable[[Mapping[str, Any]], float]] = {
    "success rate": lambda team: team["goals"] / team["episodes"],
    "cost per goal": lambda team: team["steps"] / max(team["goals"], 1),
    "own goals per 100 episodes": lambda team: 100 * team["own_goals"] / team["episodes"],
    "timeouts per 100 episodes": lambda team: 100 * team["timeouts"] / team["episodes"],
    "collisions begun per episode": lambda team: team["collisions_begun"] / team["episodes"],
    "contact steps per episode": lambda team: team["collision_steps"] / team["episodes"],
}


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
    difference = mean_interval([new - old for old, new in zip(before, after, strict=True)])
    trees, tuned, played, name = what
    mean_before = sum(before) / len(before)
    row = {
        "trees": trees,
        "tuned": tuned,
        "played": played,
        "measure": name,
        "n": len(before),
        "before": mean_before,
        "after": sum(after) / len(after),
        "percent": 100 * difference.estimate / mean_before if mean_before else None,
        "difference": difference.estimate,
        "low": difference.low,
        "high": difference.high,
        "p": paired_p_value(after, before),
    }
    return finite(row)


def figures(_results: Mapping[str, Result], _directory: Path) -> list[Path]:
    """There are none."""
    return []
