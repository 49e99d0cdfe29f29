"""Eq. 22: extra-trees. The numbers of a split by hand, what every tree keeps, and how well a forest predicts."""

from __future__ import annotations

import numpy as np
import pytest
from fbql_fusion.core.tasks.soccer.world_model.forest import (
    Forest,
    bounds_of,
    fit_forest,
    leaf_of,
    no_forest,
    part,
    split_gains,
    sums_to_the_right,
    total_of,
)
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def predicted(forest: Forest, x: Floats) -> Floats:
    """The mean of all trees, [N, m]."""
    trees = range(len(forest.roots))
    return np.array([np.mean([forest.outputs[leaf_of(forest, tree, row)] for tree in trees], axis=0) for row in x])


def some(count: int, seed: int = 0) -> tuple[Floats, Floats]:
    rng = np.random.default_rng(seed)
    x = rng.uniform(-1.0, 1.0, (count, 3))
    return x, np.column_stack([x[:, 0] > 0.2, 100.0 * x[:, 1]]).astype(np.float64)


def test_the_gain_of_a_split_is_what_it_explains() -> None:
    x = np.array([[0.0], [1.0], [2.0], [3.0]])
    y = np.array([[1.0], [2.0], [10.0], [20.0]])
    counts, sums = sums_to_the_right(x, y, np.arange(4), np.array([1.5]))
    assert counts.tolist() == [2]
    assert sums.tolist() == [[30.0]]
    assert split_gains(np.array([33.0]), 4, counts, sums, 2).tolist() == [3.0**2 / 2 + 30.0**2 / 2]


def test_a_split_with_too_small_a_part_gains_nothing() -> None:
    counts = np.array([1, 3])
    assert split_gains(np.array([4.0]), 4, counts, np.array([[1.0, 3.0]]), 2).tolist() == [-1.0, -1.0]


def test_a_row_on_the_threshold_belongs_to_the_right_part() -> None:
    x, y = np.array([[1.0], [2.0]]), np.array([[5.0], [7.0]])
    counts, sums = sums_to_the_right(x, y, np.arange(2), np.array([2.0]))
    assert (counts.tolist(), sums.tolist()) == ([1], [[7.0]])


def test_an_input_on_the_threshold_leads_to_the_right_child() -> None:
    nodes = np.array([[1.0, 0.5, 2.0], [-1.0, 0.0, 0.0], [-1.0, 0.0, 1.0]])
    forest = Forest(np.zeros(1, dtype=np.int64), nodes, np.zeros((2, 1)))
    assert [leaf_of(forest, 0, np.array([9.0, x])) for x in (0.4, 0.5, 0.6)] == [0, 1, 1]


def test_rows_are_parted_in_their_order_and_one_on_the_threshold_goes_to_the_right() -> None:
    x = np.array([[3.0], [1.0], [2.0], [0.0]])
    for split in (part.interpreted, part.function):
        rows = np.arange(4)
        assert split(x, rows, 0, 2.0) == 2
        assert rows.tolist() == [1, 3, 0, 2]


@pytest.mark.parametrize("count", [1, 2, 3, 40])
def test_each_loop_has_the_bits_of_its_numpy_form(count: int) -> None:
    """What is compiled is the loop."""
    x, y = some(50, seed=count)
    rng = np.random.default_rng(count)
    rows, thresholds = rng.permutation(50)[:count], np.array([x[7, 0], 0.2, -0.3])
    looped, formed = (
        each(x, y, rows, thresholds) for each in (sums_to_the_right.function, sums_to_the_right.interpreted)
    )
    assert [each.tobytes() for each in looped] == [each.tobytes() for each in formed]
    assert looped[0].dtype == formed[0].dtype
    assert total_of.function(y, rows).tobytes() == total_of.interpreted(y, rows).tobytes()
    low, high = bounds_of.function(x, rows)
    assert [low.tobytes(), high.tobytes()] == [each.tobytes() for each in bounds_of.interpreted(x, rows)]
    assert (low.tolist(), high.tolist()) == (np.min(x[rows], axis=0).tolist(), np.max(x[rows], axis=0).tolist())


def test_every_row_is_in_one_leaf_of_each_tree_and_no_leaf_is_too_small() -> None:
    x, y = some(200)
    forest = fit_forest(x, y, 4, 7, np.random.default_rng(1))
    for tree in range(4):
        leaves = [leaf_of(forest, tree, row) for row in x]
        assert min(np.unique(leaves, return_counts=True)[1]) >= 7
        for leaf in set(leaves):
            own = [i for i, each in enumerate(leaves) if each == leaf]
            assert forest.outputs[leaf] == pytest.approx(y[own].mean(axis=0))


def test_a_forest_predicts_what_depends_on_its_inputs_whatever_the_outputs_units() -> None:
    x, y = some(600)
    forest = fit_forest(x, y, 5, 3, np.random.default_rng(1))
    new, wanted = some(200, seed=5)
    error = ((predicted(forest, new) - wanted) ** 2).mean(axis=0) / wanted.var(axis=0)
    assert error.max() < 0.1


def test_trees_differ_and_the_same_generator_gives_the_same_forest() -> None:
    x, y = some(100)
    first, again = (fit_forest(x, y, 2, 3, np.random.default_rng(1)) for _ in range(2))
    assert all(np.array_equal(a, b) for a, b in zip(first, again, strict=True))
    assert first.nodes[first.roots[0], 1] != first.nodes[first.roots[1], 1]


def test_from_too_few_rows_nothing_is_predicted() -> None:
    x, y = some(5)
    assert len(fit_forest(x, y, 5, 3, np.random.default_rng(1)).roots) == 0
    assert len(no_forest(2).roots) == 0


def test_few_rows_become_a_leaf_each_where_a_leaf_may_hold_one() -> None:
    x = np.arange(3.0)[:, None]
    forest = fit_forest(x, x, 3, 1, np.random.default_rng(1))
    assert [len({leaf_of(forest, tree, row) for row in x}) for tree in range(3)] == [3, 3, 3]


def test_as_many_rows_as_two_leaves_need_are_split() -> None:
    x = np.repeat([[0.0], [1.0]], 3, axis=0)
    forest = fit_forest(x, 10.0 * x, 2, 3, np.random.default_rng(1))
    assert forest.roots.tolist() == [0, 3]
    assert forest.outputs.tolist() == [[0.0], [10.0]] * 2
    assert len(fit_forest(x[:5], x[:5], 2, 3, np.random.default_rng(1)).roots) == 0


def test_inputs_that_never_differ_are_not_split_on() -> None:
    x, y = some(50)
    x[:, 0] = 0.3
    forest = fit_forest(x, y, 2, 3, np.random.default_rng(1))
    assert set(forest.nodes[:, 0].tolist()) == {-1, 1, 2}
    x[:] = 0.3
    assert len(fit_forest(x, y, 2, 3, np.random.default_rng(1)).outputs) == 2
