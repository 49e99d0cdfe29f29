"""The ways to make a tree that the study compares, each a function of a behavior's patterns.

Methods are grouped in families, because a worker makes and plays one family at a time.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

from fbql_behaviors.cart import grow_cart
from fbql_behaviors.core.patterns import Patterns
from fbql_behaviors.core.quantizer import levels_of_classes, rad_s_of
from fbql_behaviors.core.tree import Leaf, Tree
from fbql_behaviors.sklearn_trees import from_sklearn

from fbql_studies.common.pattern_sets import Grown, PatternSet, induced
from fbql_studies.runner.study import MEASURED, Result
from fbql_studies.trees.optimal import optimal_tree

TRIALS = (5, 20, 50, 200, 1000)
FIRST_SEED = 1001
"""The first demonstration seed, which is the run seed of play as well."""
KNOWN_SEEDS = range(1, 9)
"""Demonstration seeds that the recipes were chosen on."""
BANDS = {"ball_seeking": (95, 135), "wall_avoiding": (7, 15), "approaching": (30, 42)}
"""Accepted leaf counts, around the paper's 122, 11 and 37."""
SHIPPED = "weighted rl 50"
"""The method of the shipped trees, the reference of every comparison."""


Method = Callable[[PatternSet], Grown | None]
"""None: the method did not finish."""


def within_printed_limits(patterns: PatternSet) -> Grown:
    """The weighted objective with the stop criteria of the printed one: isolates the effect of the objective."""
    limits = patterns.recipe.printed
    return induced(patterns, "weighted", method="dp", min_range=limits.min_range, min_patterns=limits.min_patterns)


def cart(patterns: PatternSet, leaves: int | None) -> Grown:
    """CART by squared error of both wheels' levels, best split first; None: cross-validation chooses the leaves."""
    return Grown(grow_cart(patterns.behavior, patterns.training, patterns.seed, leaves).tree)


def cart_by_entropy(patterns: PatternSet, leaves: int) -> Grown:
    """CART by the entropy of the classes (eq. 2), best split first, with leaves that answer the mean, as ours do."""
    from sklearn.tree import DecisionTreeClassifier

    model = DecisionTreeClassifier(criterion="entropy", max_leaf_nodes=leaves, random_state=patterns.seed)
    model.fit(patterns.training.x, patterns.training.wheel_class)
    return Grown(with_leaf_means(from_sklearn(model, patterns.behavior, patterns.training.features), patterns.training))


def optimal(patterns: PatternSet, depth: int, leaves: int) -> Grown | None:
    """The tree of least squared error on the patterns."""
    tree = optimal_tree(patterns.behavior, patterns.training, depth, leaves)
    return None if tree is None else Grown(with_leaf_means(tree, patterns.training))


def with_leaf_means(tree: Tree, patterns: Patterns) -> Tree:
    """The same partition; each leaf answers the mean of its patterns' quantized wheel velocities."""
    levels = levels_of_classes(patterns.wheel_class)
    leaf_ids = tree.leaf_ids(patterns.x)
    leaves: list[Leaf] = []
    for leaf_id, leaf in enumerate(tree.leaves):
        inside = levels[leaf_ids == leaf_id]
        if len(inside):
            left, right = inside.mean(axis=0).tolist()
            leaf = Leaf(rad_s_of(left), rad_s_of(right), len(inside))
        leaves.append(leaf)
    return replace(tree, leaves=tuple(leaves))


def _of_objective(objective: str) -> dict[str, Method]:
    by_trials = {f"{objective} rl {n}": partial(induced, objective=objective, trials=n) for n in TRIALS}
    return {**by_trials, f"{objective} dp": partial(induced, objective=objective, method="dp")}


def _without_optimism(objective: str) -> dict[str, Method]:
    """Q starts at 0 and exploration is purely random: all actions of the first trial are random, none of the last."""
    usual = partial(induced, objective=objective, optimism=0.0, epsilon_start=1.0, epsilon_end=0.0)
    return {f"{objective} rl {n}, Q from 0": partial(usual, trials=n) for n in TRIALS}


FAMILIES: Mapping[str, Mapping[str, Method]] = {
    "weighted": _of_objective("weighted"),
    "printed": _of_objective("printed"),
    "weighted-from-0": _without_optimism("weighted"),
    "printed-from-0": _without_optimism("printed"),
    "others": {
        "weighted dp, printed's limits": within_printed_limits,
        "cart": lambda patterns: cart(patterns, patterns.equal_leaves),
        "cart by entropy": lambda patterns: cart_by_entropy(patterns, patterns.equal_leaves),
        "cart, cross-validated": lambda patterns: cart(patterns, None),
        "one leaf": lambda patterns: Grown(induced(patterns, "weighted", method="dp", max_entropy=10.0).tree),
    },
    "optimal": {
        "optimal, 8 leaves": lambda patterns: optimal(patterns, 3, 8),
        "optimal": lambda patterns: optimal(patterns, 5, patterns.equal_leaves),
    },
}
"""Family -> method -> the function that makes it. `optimal` needs pystreed."""


def methods_of(results: Mapping[str, Result]) -> dict[str, dict[int, dict[str, Any]]]:
    """Method -> seed -> its trees, play and seconds, in the order of FAMILIES."""
    found: dict[str, dict[int, dict[str, Any]]] = {method: {} for family in FAMILIES.values() for method in family}
    for key, result in results.items():
        for method, each in result.get("methods", {}).items():
            found[method][int(key.split("-")[0])] = {**each, "seconds": result[MEASURED]["seconds"][method]}
    return {method: by_seed for method, by_seed in found.items() if by_seed}
