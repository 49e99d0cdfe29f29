"""How closely a tree imitates its instructor: the error of its wheel velocities on patterns.

The class error says little here: with 841 classes a neighbouring class is a miss, and even the best trees miss three in
four.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from fbql_behaviors.core.patterns import Patterns
from fbql_behaviors.core.quantizer import LEVEL_RAD_S, levels_of_classes
from fbql_behaviors.core.tree import Tree

FOLDS = 5


def wheel_rmse(tree: Tree, patterns: Patterns) -> float:
    """Root of the mean squared error of both wheels' references against the patterns' classes [levels]."""
    return _root_mean_square(wheel_errors(tree, patterns))


def wheel_errors(tree: Tree, patterns: Patterns) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    """Reference minus quantized velocity of each pattern and wheel: [n, 2] [levels]."""
    return tree.references(patterns.x) / LEVEL_RAD_S - levels_of_classes(patterns.wheel_class)


def cross_validated_rmse(patterns: Patterns, make: Callable[[Patterns], Tree]) -> float | None:
    """The error [levels] on held-out demonstrations, cross-validated in `FOLDS` folds.

    `make` induces a tree from patterns. Demonstration k is held out as a whole, in fold k mod FOLDS, since its patterns
    resemble each other. None with fewer than two demonstrations.
    """
    numbers = np.unique(patterns.demonstration)
    if len(numbers) < 2:
        return None
    fold = np.searchsorted(numbers, patterns.demonstration) % FOLDS
    errors = [
        wheel_errors(make(patterns.select(fold != k)), patterns.select(fold == k))
        for k in range(min(FOLDS, len(numbers)))
    ]
    return _root_mean_square(np.concatenate(errors))


def _root_mean_square(errors: np.ndarray[tuple[int, int], np.dtype[np.float64]]) -> float:
    return float(np.sqrt(np.mean(errors**2)))
