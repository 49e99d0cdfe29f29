"""How closely a tree imitates its instructor: the error of its wheel velocities, or other commands, on patterns.

The class error says little here: with 841 classes a neighboring class is a miss, and even the best trees miss three in
four.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from fbql_behaviors.core.levels import in_levels, levels_at, step_of
from fbql_behaviors.core.patterns import Patterns
from fbql_behaviors.core.tree import Tree

FOLDS = 5


def wheel_rmse(tree: Tree, patterns: Patterns) -> float:
    """Root of the mean squared error of the references, over all axes, against the patterns' classes [levels]."""
    return _root_mean_square(wheel_errors(tree, patterns))


def wheel_errors(tree: Tree, patterns: Patterns) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    """Reference minus quantized command of each pattern and axis: [n, axes] [levels]."""
    return in_levels(patterns.commands, tree.references(patterns.x)) - levels_at(
        patterns.commands, patterns.wheel_class
    )


def axis_rmse(tree: Tree, patterns: Patterns) -> dict[str, float]:
    """The root mean squared error of each axis, by its name, in its unit."""
    errors = wheel_errors(tree, patterns)
    return {
        axis.name: _root_mean_square(errors[:, [k]]) * step_of(axis) for k, axis in enumerate(patterns.commands.axes)
    }


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
