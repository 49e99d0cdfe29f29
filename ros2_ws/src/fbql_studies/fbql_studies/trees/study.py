"""Trees from demonstrations: objectives and methods over demonstration seeds, by held-out error and by play.

Demonstration seeds from FIRST_SEED on were used in no tuning; the recipes' settings were chosen on seeds 1 to 8, whose
leaf counts are a part of this study. The run seed of play is the demonstration seed, so that all methods of a seed meet
the same episodes.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping
from importlib import import_module
from pathlib import Path
from time import perf_counter
from typing import Any

from fbql.statistics.tables import Row
from fbql_behaviors.core.evaluation import wheel_rmse
from fbql_behaviors.core.recipes import RECIPES
from fbql_behaviors.core.tree import Tree
from fbql_behaviors.core.tree_value import tree_value

from fbql_studies.common.pattern_sets import OBJECTIVES, Grown, PatternSet, induced, setting
from fbql_studies.common.team_play import PRESETS, RETUNED, retuned, score
from fbql_studies.runner.study import (
    MEASURED,
    MOST_PLAYED,
    MOST_SEEDS,
    Parameters,
    Result,
    StudyTask,
    add_count,
    check_counts,
)
from fbql_studies.trees import tables
from fbql_studies.trees.methods import FAMILIES, FIRST_SEED, KNOWN_SEEDS, cart, cart_by_entropy
from fbql_studies.trees.optimal import make_importable

DESCRIPTION = "trees from demonstrations: objectives, trials and other methods, by held-out error and by play"
CAPTIONS = {
    "trees_patterns": "The paper's Fig. 2: the patterns of each behavior, 1000 of demonstration seed 1001; blue turns left, orange turns right, white drives straight",
    "trees_divergence": "The root's value over the trials, by eq. 4 as printed and with -Q",
    "trees_trials": "Value, held-out error and play against the number of trials; lines are medians over the seeds (of the team: sums over them), bands the range (of the team: 95 %), DP is the exact optimum",
    "trees_sizes": "Held-out error against the number of leaves: exact trees of either objective, and CART of every size",
    "trees_play": "Steps per goal and success rate of each method's trees, with 95 % intervals over the seeds",
    "trees_leaf_counts": "Leaves over demonstration seeds, and the paper's",
    "trees_partition": "The paper's Fig. 3: the leaves of each behavior after 50 trials with demonstration seed 1001, by the weighted objective (above) and the printed one (below); the color is how sharply a leaf turns, hatched leaves drive backwards",
}
COLUMNS, table, words = tables.COLUMNS, tables.table, tables.words
SPLIT_COSTS = (0.0, 0.001, 0.002, 0.004, 0.006, 0.01, 0.015, 0.025, 0.04, 0.06, 0.1, 0.15, 0.2, 0.25, 0.3, 0.4, 0.6)
LEAF_COUNTS = (2, 3, 4, 6, 8, 11, 16, 23, 32, 45, 64, 91, 128, 181, 256)


def add_options(parser: argparse.ArgumentParser) -> None:
    """Adds the study's own options."""
    add_count(parser, "--seeds", 10, "demonstration seeds")
    add_count(parser, "--episodes", 100, "episodes of each set of trees and thresholds")
    parser.add_argument(
        "--pystreed",
        metavar="DIR",
        help="grow optimal trees, too, with the pystreed that is installed in DIR (pip install --target DIR pystreed; "
        "it depends on a package under the GPL and is not among our requirements)",
    )


def tasks(options: argparse.Namespace) -> list[StudyTask]:
    """For each seed a task for each family of methods and one for the sizes of trees; one task for the known seeds."""
    check_counts(options, seeds=MOST_SEEDS, episodes=MOST_PLAYED)
    if options.pystreed:
        make_importable(options.pystreed)
    found = [StudyTask("known-seeds", {"part": "known"})]
    for seed in range(FIRST_SEED, FIRST_SEED + options.seeds):
        found.append(StudyTask(f"{seed}-sizes", {"part": "sizes", "seed": seed}))
        for family in FAMILIES:
            if family != "optimal" or options.pystreed:
                parameters = {"part": family, "seed": seed, "episodes": options.episodes, "pystreed": options.pystreed}
                found.append(StudyTask(f"{seed}-{family}", parameters))
    return found


def run(parameters: Parameters) -> Result:
    """Runs one task."""
    if parameters["part"] == "known":
        return _leaf_counts()
    if parameters["part"] == "sizes":
        return {"sizes": [row for behavior in RECIPES for row in _sizes(PatternSet(behavior, parameters["seed"]))]}
    if parameters["pystreed"]:
        make_importable(parameters["pystreed"])
    return _family(parameters["part"], parameters["seed"], parameters["episodes"])


def _leaf_counts() -> Result:
    """Leaf counts of the recipes' trees on the seeds that they were chosen on: objective -> behavior -> counts."""
    counts: dict[str, dict[str, list[int]]] = {}
    for behavior in RECIPES:
        sets = [PatternSet(behavior, seed) for seed in KNOWN_SEEDS]
        for objective in OBJECTIVES:
            leaves = [induced(patterns, objective).tree.leaf_count for patterns in sets]
            counts.setdefault(objective, {})[behavior] = leaves
    return {"leaves": counts}


def _sizes(patterns: PatternSet) -> Iterator[Row]:
    """Held-out error against the number of leaves: exact trees over the cost of a split, CART over its size."""
    fine = {"min_range": setting(patterns, "weighted").min_range, "min_patterns": 2}
    for objective, name, limits in (
        ("weighted", "weighted", {}),
        ("printed", "printed", fine),
        ("printed", "printed, its recipe's limits", {}),
    ):
        for cost in SPLIT_COSTS:
            grown = induced(patterns, objective, method="dp", split_cost=-cost, **limits)
            yield _size(patterns, name, grown, cost)
    for leaves in LEAF_COUNTS:
        yield _size(patterns, "cart", cart(patterns, leaves))
        yield _size(patterns, "cart by entropy", cart_by_entropy(patterns, leaves))


def _size(patterns: PatternSet, name: str, grown: Grown, split_cost: float | None = None) -> Row:
    return {
        "behavior": patterns.behavior,
        "method": name,
        "split_cost": split_cost,
        "leaves": grown.tree.leaf_count,
        "rmse_levels": wheel_rmse(grown.tree, patterns.held_out),
    }


def _family(family: str, seed: int, episodes: int) -> Result:
    """Every method of a family: its three trees, and their score in play."""
    import_module("sklearn.tree"), import_module("sklearn.cluster")  # so that the clock measures the methods alone
    sets = {behavior: PatternSet(behavior, seed).prepared() for behavior in RECIPES}
    played: dict[object, Row] = {}
    found: dict[str, Any] = {}
    seconds: dict[str, dict[str, float]] = {}
    for method, make in FAMILIES[family].items():
        trees: dict[str, Tree] = {}
        rows: dict[str, Row] = {}
        for behavior, patterns in sets.items():
            begun_s = perf_counter()
            grown = make(patterns)
            seconds.setdefault(method, {})[behavior] = perf_counter() - begun_s
            if grown is None:
                break
            trees[behavior] = grown.tree
            rows[behavior] = _tree_row(patterns, method, grown)
        else:
            partition = tuple((tree.nodes, tree.leaves) for tree in trees.values())
            for name in tables.settings_of(method):
                if (partition, name) not in played:  # converged methods make the same trees
                    played[partition, name] = _played(trees, name, seed, episodes)
            found[method] = {
                "trees": rows,
                "play": {name: played[partition, name] for name in tables.settings_of(method)},
            }
    return {"methods": found, MEASURED: {"seconds": seconds}}


def _tree_row(patterns: PatternSet, method: str, grown: Grown) -> Row:
    """Values are relative to the optimum of the method's own objective, of the weighted one where it has none."""
    objective = "printed" if method.startswith("printed") else "weighted"
    parameters = setting(patterns, objective)
    best = induced(patterns, objective, method="dp").belief
    assert best is not None
    return {
        "leaves": grown.tree.leaf_count,
        "rmse_levels": wheel_rmse(grown.tree, patterns.held_out),
        "rmse_training": wheel_rmse(grown.tree, patterns.training),
        "value": tree_value(grown.tree, patterns.training, parameters) / best if best else None,
        "belief": grown.belief / best if grown.belief is not None and best else None,
    }


def _played(trees: Mapping[str, Tree], name: str, seed: int, episodes: int) -> Row:
    thresholds = retuned(trees) if name == RETUNED else PRESETS[name]
    return {"thresholds": list(thresholds), **score(trees, thresholds, seed, episodes)._asdict()}


def figures(results: Mapping[str, Result], directory: Path) -> list[Path]:
    """Draws every figure for which there are results."""
    from fbql_studies.trees.figures import draw_all

    return draw_all(results, directory)
