"""CART (Breiman et al. 1984) by scikit-learn, as a baseline for our induction: a tree of our own type from the same
patterns.

It is a DecisionTreeRegressor of the levels of both wheels, or other axes, grown best split first, so that its size is a number of leaves. Unless
a size is given, cross-validation by demonstration chooses it. Only this module needs scikit-learn.
"""

from __future__ import annotations

from functools import partial
from importlib import import_module
from typing import Any, NamedTuple

from fbql_common.checkout import how_to_install
from fbql_common.core.errors import BadInput

from fbql_behaviors.core.evaluation import cross_validated_rmse
from fbql_behaviors.core.levels import levels_at
from fbql_behaviors.core.patterns import Patterns
from fbql_behaviors.core.quantizer import LEVEL_RAD_S
from fbql_behaviors.core.tree import Tree
from fbql_behaviors.sklearn_trees import from_sklearn

LEAF_COUNTS = (1, 2, 3, 4, 6, 8, 11, 16, 23, 32, 45, 64, 91, 128, 181, 256)
"""The sizes that cross-validation tries, each about 1.4 times the previous one."""


class Cart(NamedTuple):
    """A CART tree, and the held-out error [levels] of each size that was tried."""

    tree: Tree
    tried: dict[int, float]


def grow_cart(behavior: str, patterns: Patterns, seed: int, leaves: int | None = None) -> Cart:
    """CART's tree of patterns with at most `leaves` leaves; None: as many as cross-validation chooses.

    `seed` decides between equally good splits. Raises BadInput without scikit-learn, or for fewer than one leaf.
    """
    if leaves is not None and leaves < 1:
        raise BadInput(f"a tree of {leaves} leaves; it needs at least 1")
    tried: dict[int, float] = {}
    if leaves is None:
        tried = held_out_by_leaves(behavior, patterns, seed)
        leaves = min(tried, key=tried.__getitem__, default=1)
    return Cart(_grow(behavior, seed, leaves, patterns), tried)


def held_out_by_leaves(behavior: str, patterns: Patterns, seed: int) -> dict[int, float]:
    """The cross-validated error [levels] of each size in `LEAF_COUNTS`; empty with fewer than two demonstrations."""
    errors: dict[int, float] = {}
    for leaves in LEAF_COUNTS:
        rmse = cross_validated_rmse(patterns, partial(_grow, behavior, seed, leaves))
        if rmse is not None and leaves <= len(patterns):
            errors[leaves] = rmse
    return errors


def _grow(behavior: str, seed: int, leaves: int, patterns: Patterns) -> Tree:
    sklearn, trees = scikit_learn()
    # scikit-learn's max_leaf_nodes begins at 2.
    size = {"max_depth": 1, "min_samples_split": len(patterns) + 2} if leaves == 1 else {"max_leaf_nodes": leaves}
    estimator = trees.DecisionTreeRegressor(random_state=seed % 2**32, **size)
    estimator.fit(patterns.x, levels_at(patterns.commands, patterns.wheel_class))
    origin = {
        "method": "cart",
        "leaves": leaves,
        "seed": seed,
        "scikit_learn": str(sklearn.__version__),
        "patterns": len(patterns),
        "patterns_sha256": patterns.sha256,
    }
    return from_sklearn(estimator, behavior, patterns.features, origin, LEVEL_RAD_S, patterns.commands)


def scikit_learn() -> tuple[Any, Any]:
    """The modules sklearn and sklearn.tree; the first call takes a second. Raises BadInput when they are not installed."""
    try:
        return import_module("sklearn"), import_module("sklearn.tree")
    except ModuleNotFoundError:
        raise BadInput(f"CART needs scikit-learn, which is not installed: {how_to_install('studies')}") from None
