"""How closely a tree imitates: errors in levels, and held-out ones, by hand and by a slow oracle."""

from __future__ import annotations

import numpy as np
import pytest
from fbql_behaviors.core.evaluation import axis_rmse, cross_validated_rmse, wheel_errors, wheel_rmse
from fbql_behaviors.core.patterns import Patterns, patterns_from_rows
from fbql_behaviors.core.quantizer import LEVEL_RAD_S, levels_of_classes, wheel_class_of
from fbql_behaviors.core.tree import Leaf, Split, Tree
from tree_strategies import PLANE


def constant(left_levels: float, right_levels: float) -> Tree:
    """A tree of one leaf."""
    return Tree("t", PLANE, (0,), (Leaf(left_levels * LEVEL_RAD_S, right_levels * LEVEL_RAD_S, 1),))


def driven(levels: list[tuple[int, int]], demonstration: list[int] | None = None) -> Patterns:
    """Patterns at x = 0, 0.1, ... with these levels of the wheels."""
    classes = [wheel_class_of(left * LEVEL_RAD_S, right * LEVEL_RAD_S) for left, right in levels]
    return patterns_from_rows(PLANE, [(0.1 * k, 0.0) for k in range(len(levels))], classes, demonstration)


def test_an_error_is_the_reference_minus_the_demonstrated_velocity_in_levels() -> None:
    tree = Tree(
        "t", PLANE, (Split(0, 0.05, 1, 2), 0, 1), (Leaf(2 * LEVEL_RAD_S, 0.0, 1), Leaf(0.0, 5 * LEVEL_RAD_S, 1))
    )
    patterns = driven([(1, 2), (3, 5)])
    assert wheel_errors(tree, patterns) == pytest.approx(np.array([[1.0, -2.0], [-3.0, 0.0]]))
    assert wheel_rmse(tree, patterns) == pytest.approx(((1 + 4 + 9) / 4) ** 0.5)
    left, right = ((1 + 9) / 2) ** 0.5, (4 / 2) ** 0.5
    assert list(axis_rmse(tree, patterns).values()) == pytest.approx([left * LEVEL_RAD_S, right * LEVEL_RAD_S])
    assert list(axis_rmse(tree, patterns)) == [axis.name for axis in patterns.commands.axes]


def mean_tree(patterns: Patterns) -> Tree:
    """Of one leaf with the mean of the patterns."""
    return constant(*levels_of_classes(patterns.wheel_class).mean(axis=0).tolist())


@pytest.mark.parametrize("demonstrations", [2, 4, 5, 7, 12])
def test_every_demonstration_is_held_out_as_a_whole_in_one_of_five_folds(demonstrations: int) -> None:
    generator = np.random.default_rng(demonstrations)
    numbers = sorted(generator.permutation([3 * k for k in range(demonstrations)] * 4).tolist())
    levels = generator.integers(-9, 10, (len(numbers), 2)).tolist()
    patterns = driven([(left, right) for left, right in levels], numbers)
    squares: list[float] = []
    for fold in range(5):
        held = [k for k, number in enumerate(numbers) if number // 3 % 5 == fold]
        others = [k for k in range(len(numbers)) if k not in held]
        for wheel in range(2):
            mean = sum(levels[k][wheel] for k in others) / len(others)
            squares += [(mean - levels[k][wheel]) ** 2 for k in held]
    assert cross_validated_rmse(patterns, mean_tree) == pytest.approx((sum(squares) / len(squares)) ** 0.5)


def test_of_one_demonstration_nothing_can_be_held_out() -> None:
    assert cross_validated_rmse(driven([(1, 2), (3, 4)], [7, 7]), mean_tree) is None
