"""Trees from demonstrations: objectives and methods over demonstration seeds, by held-out error and by play.

Demonstration seeds from FIRST_SEED on were seen by no tuning; the recipes' settings were chosen on seeds 1 to 8, whose leaf
counts are a part of the study of their own. The run seed of play is the demonstration seed, so that all methods of a seed
meet the same episodes.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Iterator, Mapping, Sequence
from importlib import import_module
from math import nan
from pathlib import Path
from statistics import median
from time import perf_counter
from typing import Any

from fbql.statistics.inference import Interval, paired_p_value, ratio_of_sums
from fbql.statistics.tables import Row, finite
from fbql_behaviors.core.evaluation import wheel_rmse
from fbql_behaviors.core.quantizer import rad_s_of
from fbql_behaviors.core.recipes import RECIPES
from fbql_behaviors.core.tree import Tree
from fbql_behaviors.core.tree_value import tree_value

from fbql_studies import tree_words
from fbql_studies.optimal_trees import make_importable
from fbql_studies.runner.study import MEASURED, MOST_PLAYED, MOST_SEEDS, Parameters, Result, Task, check_counts
from fbql_studies.tree_methods import (
    BANDS,
    FAMILIES,
    FIRST_SEED,
    KNOWN_SEEDS,
    OBJECTIVES,
    SHIPPED,
    Grown,
    Lesson,
    cart,
    cart_by_entropy,
    induced,
    methods_of,
    setting,
)
from fbql_studies.tree_play import FIXED_ONLY, PRESETS, PRESETS_ONLY, RETUNED, SETTINGS, Score, retuned, score

DESCRIPTION = "trees from demonstrations: objectives, trials and other methods, by held-out error and by play"
CAPTIONS = {
    "trees_patterns": "The paper's Fig. 2: the patterns of each behavior, 1000 of demonstration seed 1001; blue turns left, orange turns right, white drives straight",
    "trees_divergence": "The root's value over the trials, by eq. 4 as printed and with -Q",
    "trees_trials": "Value, held-out error and play against the number of trials; lines are medians over the seeds (of the team: sums over them), bands the range (of the team: 95 %), DP is the exact optimum",
    "trees_sizes": "Held-out error against the number of leaves: exact trees of either objective, and CART of every size",
    "trees_play": "Steps per goal and success rate of each method's trees, with 95 % intervals over the seeds",
    "trees_leaf_counts": "Leaves over demonstration seeds, and the paper's",
    "trees_partition": "The paper's Fig. 3: the leaves of each behavior after 50 trials with demonstration seed 1001, by the weighted objective (above) and the printed one (below); the colour is how sharply a leaf turns, hatched leaves drive backwards",
}
COLUMNS = tree_words.COLUMNS
words = tree_words.tables
CARTS = ("cart", "cart by entropy")
"""The methods that errors are compared with, at as many leaves as the exact tree of the weighted objective."""
SPLIT_COSTS = (0.0, 0.001, 0.002, 0.004, 0.006, 0.01, 0.015, 0.025, 0.04, 0.06, 0.1, 0.15, 0.2, 0.25, 0.3, 0.4, 0.6)
LEAF_COUNTS = (2, 3, 4, 6, 8, 11, 16, 23, 32, 45, 64, 91, 128, 181, 256)


def add_options(parser: argparse.ArgumentParser) -> None:
    """Adds the study's own options."""
    parser.add_argument("--seeds", type=int, default=10, metavar="N", help="demonstration seeds (10)")
    parser.add_argument(
        "--episodes", type=int, default=100, metavar="N", help="episodes of each set of trees and thresholds (100)"
    )
    parser.add_argument(
        "--pystreed",
        metavar="DIR",
        help="grow optimal trees, too, with the pystreed that is installed in DIR (pip install --target DIR pystreed; "
        "it depends on a package under the GPL and is not among our requirements)",
    )


def tasks(options: argparse.Namespace) -> list[Task]:
    """For each seed a task for each family of methods and one for the sizes of trees; one for the known seeds."""
    check_counts(options, seeds=MOST_SEEDS, episodes=MOST_PLAYED)
    if options.pystreed:
        make_importable(options.pystreed)
    found = [Task("known-seeds", {"part": "known"})]
    for seed in range(FIRST_SEED, FIRST_SEED + options.seeds):
        found.append(Task(f"{seed}-sizes", {"part": "sizes", "seed": seed}))
        for family in FAMILIES:
            if family != "optimal" or options.pystreed:
                parameters = {"part": family, "seed": seed, "episodes": options.episodes, "pystreed": options.pystreed}
                found.append(Task(f"{seed}-{family}", parameters))
    return found


def run(parameters: Parameters) -> Result:
    """Does one task."""
    if parameters["part"] == "known":
        return _leaf_counts()
    if parameters["part"] == "sizes":
        return {"sizes": [row for behavior in RECIPES for row in _sizes(Lesson(behavior, parameters["seed"]))]}
    if parameters["pystreed"]:
        make_importable(parameters["pystreed"])
    return _family(parameters["part"], parameters["seed"], parameters["episodes"])


def _leaf_counts() -> Result:
    """The leaves of the recipes' trees on the seeds that they were chosen on: objective -> behavior -> leaves."""
    counts: dict[str, dict[str, list[int]]] = {}
    for behavior in RECIPES:
        lessons = [Lesson(behavior, seed) for seed in KNOWN_SEEDS]
        for objective in OBJECTIVES:
            leaves = [induced(lesson, objective).tree.leaf_count for lesson in lessons]
            counts.setdefault(objective, {})[behavior] = leaves
    return {"leaves": counts}


def _sizes(lesson: Lesson) -> Iterator[Row]:
    """Held-out error against the number of leaves: exact trees over the cost of a split, CART over its size."""
    fine = {"min_range": setting(lesson, "weighted").min_range, "min_patterns": 2}
    for objective, name, limits in (
        ("weighted", "weighted", {}),
        ("printed", "printed", fine),
        ("printed", "printed, its recipe's limits", {}),
    ):
        for cost in SPLIT_COSTS:
            grown = induced(lesson, objective, method="dp", split_cost=-cost, **limits)
            yield _size(lesson, name, grown, cost)
    for leaves in LEAF_COUNTS:
        yield _size(lesson, "cart", cart(lesson, leaves))
        yield _size(lesson, "cart by entropy", cart_by_entropy(lesson, leaves))


def _size(lesson: Lesson, name: str, grown: Grown, split_cost: float | None = None) -> Row:
    return {
        "behavior": lesson.behavior,
        "method": name,
        "split_cost": split_cost,
        "leaves": grown.tree.leaf_count,
        "rmse_levels": wheel_rmse(grown.tree, lesson.held_out),
    }


def _family(family: str, seed: int, episodes: int) -> Result:
    """Every method of a family: its three trees, and what they are worth in play."""
    import_module("sklearn.tree"), import_module("sklearn.cluster")  # the clock is to see the methods alone
    lessons = {behavior: Lesson(behavior, seed).prepared() for behavior in RECIPES}
    played: dict[object, Row] = {}
    found: dict[str, Any] = {}
    seconds: dict[str, dict[str, float]] = {}
    for method, make in FAMILIES[family].items():
        trees: dict[str, Tree] = {}
        rows: dict[str, Row] = {}
        for behavior, lesson in lessons.items():
            begun_s = perf_counter()
            grown = make(lesson)
            seconds.setdefault(method, {})[behavior] = perf_counter() - begun_s
            if grown is None:
                break
            trees[behavior] = grown.tree
            rows[behavior] = _tree_row(lesson, method, grown)
        else:
            partition = tuple((tree.nodes, tree.leaves) for tree in trees.values())
            for name in _settings(method):
                if (partition, name) not in played:  # methods that have converged make the same trees
                    played[partition, name] = _played(trees, name, seed, episodes)
            found[method] = {"trees": rows, "play": {name: played[partition, name] for name in _settings(method)}}
    return {"methods": found, MEASURED: {"seconds": seconds}}


def _tree_row(lesson: Lesson, method: str, grown: Grown) -> Row:
    """Values are relative to the optimum of the method's own objective; other methods are held against the weighted."""
    objective = "printed" if method.startswith("printed") else "weighted"
    parameters = setting(lesson, objective)
    best = induced(lesson, objective, method="dp").belief
    assert best is not None
    return {
        "leaves": grown.tree.leaf_count,
        "rmse_levels": wheel_rmse(grown.tree, lesson.held_out),
        "rmse_training": wheel_rmse(grown.tree, lesson.patterns),
        "value": tree_value(grown.tree, lesson.patterns, parameters) / best if best else None,
        "belief": grown.belief / best if grown.belief is not None and best else None,
    }


def _settings(method: str) -> tuple[str, ...]:
    """Which thresholds a method's trees are played with; trees that hardly score are not worth tuning for."""
    if method.endswith("Q from 0"):
        return FIXED_ONLY
    return PRESETS_ONLY if method.endswith((" rl 5", " rl 20", "one leaf")) else SETTINGS


def _played(trees: Mapping[str, Tree], name: str, seed: int, episodes: int) -> Row:
    thresholds = retuned(trees) if name == RETUNED else PRESETS[name]
    return {"thresholds": list(thresholds), **score(trees, thresholds, seed, episodes)._asdict()}


def table(results: Mapping[str, Result]) -> list[Row]:
    """Four tables: each method's trees, their worth in play, leaves and error against size, leaves of known seeds."""
    by_method = methods_of(results)
    rows = [_tree_summary(method, behavior, by_method) for method in by_method for behavior in RECIPES]
    rows += [
        _play_summary(method, name, by_method) for name in SETTINGS for method in by_method if name in _settings(method)
    ]
    rows += _size_summaries([row for result in results.values() for row in result.get("sizes", [])])
    for result in results.values():
        for objective, counts in result.get("leaves", {}).items():
            rows += [_band(objective, behavior, leaves) for behavior, leaves in counts.items()]
    return rows


def _size_summaries(sizes: Iterable[Row]) -> Iterator[Row]:
    """Medians over the seeds for each cost of a split, and for each number of leaves that CART may have."""
    groups: dict[tuple[str, str, float], list[Row]] = {}
    for row in sizes:
        limit = row["leaves"] if row["split_cost"] is None else row["split_cost"]
        groups.setdefault((row["behavior"], row["method"], limit), []).append(row)
    for (behavior, method, limit), rows in groups.items():
        yield {
            "behavior": behavior,
            "sized_by": method,
            "limit": limit,
            "n": len(rows),
            "median_leaves": median(row["leaves"] for row in rows),
            "median_rmse_levels": median(row["rmse_levels"] for row in rows),
        }


def _tree_summary(method: str, behavior: str, by_method: Mapping[str, Mapping[int, Any]]) -> Row:
    """Medians over the seeds, and the error's range."""
    by_seed = by_method[method]

    def of(name: str) -> list[float]:
        values = (each["trees"][behavior][name] for each in by_seed.values())
        return [value for value in values if value is not None]

    errors = of("rmse_levels")
    return {
        "method": method,
        "behavior": behavior,
        "n": len(by_seed),
        "leaves": median(of("leaves")),
        "leaves_low": min(of("leaves")),
        "leaves_high": max(of("leaves")),
        "rmse_levels": median(errors),
        "rmse_low": min(errors),
        "rmse_high": max(errors),
        "rmse_rad_s": rad_s_of(median(errors)),
        "rmse_training": median(of("rmse_training")),
        **{f"rmse_to_{name.replace(' ', '_')}": _error_to(name, method, behavior, by_method) for name in CARTS},
        "value_to_dp": median(of("value")) if of("value") else None,
        "belief_to_dp": median(of("belief")) if of("belief") else None,
        "seconds": median(each["seconds"][behavior] for each in by_seed.values()),
    }


def _error_to(other: str, method: str, behavior: str, by_method: Mapping[str, Mapping[int, Any]]) -> float | None:
    """The held-out error over that of another method with the same seed, the median over the seeds."""
    theirs = by_method.get(other, {})
    ratios = [
        each["trees"][behavior]["rmse_levels"] / theirs[seed]["trees"][behavior]["rmse_levels"]
        for seed, each in by_method[method].items()
        if seed in theirs
    ]
    return median(ratios) if ratios else None


def _play_summary(method: str, name: str, by_method: Mapping[str, Mapping[int, Any]]) -> Row:
    """Sums over the seeds, with bootstrap intervals over them, and a paired test against the trees that ship."""
    by_seed = by_method[method]
    scores = {seed: _score(each, name) for seed, each in by_seed.items()}
    success = _interval(scores.values(), "goals", "episodes")
    cost = _interval(scores.values(), "steps", "goals")
    shipped = {seed: _score(each, name) for seed, each in by_method.get(SHIPPED, {}).items() if seed in scores}
    paired = [(scores[seed], other) for seed, other in shipped.items()]
    row: Row = {
        "method": method,
        "thresholds": name,
        "n": len(scores),
        "episodes": sum(each.episodes for each in scores.values()),
        "success_rate": success.estimate,
        "success_low": success.low,
        "success_high": success.high,
        "cost_per_goal": cost.estimate,
        "cost_low": cost.low,
        "cost_high": cost.high,
        "own_goals": _interval(scores.values(), "own_goals", "episodes").estimate,
        "timeouts": _interval(scores.values(), "timeouts", "episodes").estimate,
        "collisions_begun": _interval(scores.values(), "collisions_begun", "episodes").estimate,
        "collision_steps": _interval(scores.values(), "collision_steps", "episodes").estimate,
        **_compared(paired if method != SHIPPED else []),
    }
    return finite(row)


def _compared(paired: Sequence[tuple[Score, Score]]) -> Row:
    """cost/goal over that of the trees that ship, on the same seeds: the ratio's interval, and p that there is none."""
    ratio, p = Interval(nan, nan, nan), None
    if paired and all(ours.goals and theirs.goals for ours, theirs in paired):
        costs = [(ours.steps / ours.goals, theirs.steps / theirs.goals) for ours, theirs in paired]
        ratio = ratio_of_sums(*map(list, zip(*costs, strict=True)))
        p = paired_p_value(*map(list, zip(*costs, strict=True)))
    return {"cost_to_shipped": ratio.estimate, "ratio_low": ratio.low, "ratio_high": ratio.high, "p": p}


def _score(each: Mapping[str, Any], name: str) -> Score:
    return Score(*(each["play"][name][field] for field in Score._fields))


def _interval(scores: Iterable[Score], numerator: str, denominator: str) -> Interval:
    counted = list(scores)
    if not any(getattr(each, denominator) for each in counted):
        return Interval(nan, nan, nan)
    return ratio_of_sums([getattr(s, numerator) for s in counted], [getattr(s, denominator) for s in counted])


def _band(objective: str, behavior: str, leaves: Sequence[int]) -> Row:
    low, high = BANDS[behavior]
    inside = sum(low <= count <= high for count in leaves)
    return {
        "objective": objective,
        "behavior": behavior,
        "leaves_of_seeds_1_to_8": " ".join(map(str, leaves)),
        "band": f"{low}-{high}",
        "inside": inside,
        "n": len(leaves),
    }


def figures(results: Mapping[str, Result], directory: Path) -> list[Path]:
    """The figures of docs/trees.md."""
    from fbql_studies.tree_figures import draw_all

    return draw_all(results, directory)
