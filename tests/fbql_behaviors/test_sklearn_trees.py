"""scikit-learn's trees as ours: the same answer for every double, from estimators and from plain arrays."""

from __future__ import annotations

from math import inf, nextafter, pi
from typing import Any

import numpy as np
import pytest
from fbql_behaviors.cart import LEAF_COUNTS, grow_cart
from fbql_behaviors.core.evaluation import cross_validated_rmse, wheel_rmse
from fbql_behaviors.core.induction import InductionParameters, induce
from fbql_behaviors.core.patterns import Patterns
from fbql_behaviors.core.quantizer import LEVEL_RAD_S, class_of_levels, levels_of_classes
from fbql_behaviors.core.tree import Leaf, Split
from fbql_behaviors.core.tree_value import tree_value
from fbql_behaviors.sklearn_trees import exact_threshold, from_arrays, from_sklearn
from fbql_behaviors.storage import tree_from_bytes, tree_to_bytes
from fbql_common.core.errors import BadInput
from hypothesis import given
from hypothesis import strategies as st
from tree_strategies import FEATURES, edge_points

ARRAYS: dict[str, Any] = {
    "children_left": [1, -1, 3, -1, -1],
    "children_right": [2, -1, 4, -1, -1],
    "feature": [0, -2, 1, -2, -2],
    "threshold": [0.5, -2.0, 0.25, -2.0, -2.0],
    "value": [[[0.0], [0.0]], [[1.0], [2.0]], [[0.0], [0.0]], [[3.0], [4.0]], [[5.0], [6.0]]],
    "n_node_samples": [9, 4, 5, 2, 3],
}


def scattered(n: int, seed: int = 0) -> Patterns:
    rng = np.random.default_rng(seed)
    x = np.stack((rng.uniform(0.0, 3.2, n), rng.uniform(-pi, pi, n)), axis=1)
    levels = np.clip(np.stack((8 * np.cos(x[:, 1]) + 3 * x[:, 0], 8 * np.sin(x[:, 1])), axis=1), -14, 14).round()
    levels = np.clip(levels + rng.integers(-1, 2, levels.shape), -14, 14).astype(int)
    wheel_class = np.array([class_of_levels(left, right) for left, right in levels.tolist()])
    return Patterns(FEATURES, x, wheel_class, np.arange(n) // 10)


@given(st.floats(-1e30, 1e30), st.floats(-1e-3, 1e-3))
def test_the_exact_threshold_says_the_same_as_rounding_to_single_precision(threshold: float, offset: float) -> None:
    exact = exact_threshold(threshold)
    near = [threshold, threshold * (1 + offset), exact, nextafter(exact, -inf), nextafter(exact, inf)]
    near += [nextafter(threshold, -inf), nextafter(threshold, inf), float(np.float32(threshold))]
    for x in near:
        assert (x < exact) == (float(np.float32(x)) <= threshold), x


@pytest.mark.parametrize("threshold", [0.0, 0.1, 1.0 + 2.0**-24, 1.0 + 3 * 2.0**-24, -0.1, 1e-300])
def test_the_exact_threshold_holds_where_rounding_ties(threshold: float) -> None:
    exact = exact_threshold(threshold)
    for x in (exact, nextafter(exact, -inf), nextafter(exact, inf)):
        assert (x < exact) == (float(np.float32(x)) <= threshold)


def test_a_threshold_beyond_single_precision_parts_nothing() -> None:
    assert exact_threshold(-1e300) <= -3e38
    assert exact_threshold(1e300) > 3e38


def test_arrays_make_a_tree() -> None:
    tree = from_arrays(ARRAYS, "ball_seeking", FEATURES, {"method": "by hand"})
    assert tree.nodes == (Split(0, exact_threshold(0.5), 1, 2), 0, Split(1, exact_threshold(0.25), 3, 4), 1, 2)
    assert tree.leaves == (Leaf(1.0, 2.0, 4), Leaf(3.0, 4.0, 2), Leaf(5.0, 6.0, 3))
    assert tree.answer((0.5, 0.0))[0] == 0  # scikit-learn's threshold itself goes left
    assert tree_from_bytes(tree_to_bytes(tree)) == tree
    assert from_arrays(ARRAYS, "ball_seeking", FEATURES, scale_rad_s=2.0).leaves[2] == Leaf(10.0, 12.0, 3)


def test_of_a_classifier_the_heaviest_class_answers() -> None:
    weights = [[[9, 9]], [[0.75, 0.25]], [[9, 9]], [[0.5, 0.5]], [[0.1, 0.9]]]
    tree = from_arrays({**ARRAYS, "value": weights, "classes": [0, 840]}, "ball_seeking", FEATURES)
    assert [leaf[:2] for leaf in tree.leaves] == [(-88.0, -88.0), (-88.0, -88.0), (88.0, 88.0)]


def test_splits_outside_of_the_root_region_are_left_out() -> None:
    for threshold, leaf in ((7.0, 0), (-7.0, 2)):
        tree = from_arrays({**ARRAYS, "threshold": [threshold, -2.0, -7.0, -2.0, -2.0]}, "ball_seeking", FEATURES)
        assert tree.leaf_count == 1
        assert tree.leaves[0][0] == [1.0, 3.0, 5.0][leaf]


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"children_left": None}, "'children_left' is missing, or not a list"),
        ({"threshold": [0.5]}, "'threshold' has 1 entries, children_left has 5"),
        ({"children_left": []}, "0 nodes"),
        ({"children_left": [1, -1, 3, -1, 4]}, "node 4 has one child"),
        ({"children_left": [1, -1, 9, -1, -1]}, "node 2: a child is outside of 0 .. 4"),
        ({"children_left": [0, -1, 3, -1, -1]}, "node 0 is reached twice"),
        ({"children_left": [1, -1, 1, -1, -1]}, "node 1 is reached twice"),
        ({"children_left": [1, -1, "3", -1, -1]}, r"children_left\[2\] is '3', not a whole number"),
        ({"feature": [2, -2, 1, -2, -2]}, r"feature\[0\] is 2, outside of 0 .. 1"),
        ({"threshold": [float("nan"), -2, 0.25, -2, -2]}, r"threshold\[0\] is nan, not a finite number"),
        ({"threshold": [True, -2, 0.25, -2, -2]}, r"threshold\[0\] is True"),
        ({"value": [[1.0]] * 5}, r"value\[0\] has 1 numbers; a regressor of both wheels has 2"),
        ({"value": [["x", 1.0]] * 5}, r"value\[0\] is 'x'"),
        ({"value": [[500.0, 1.0]] * 5}, "left_rad_s is 500.0, outside of"),
        ({"classes": [0, 841]}, "'classes' must list wheel classes"),
        ({"classes": [0, 1, 2]}, r"value\[0\] has 2 weights for 3 classes"),
        ({"n_node_samples": [9, -4, 5, 2, 3]}, "patterns is -4, below 0"),
    ],
)  # fmt: skip
def test_arrays_that_are_no_tree_of_wheels_are_refused_with_the_place(change: dict[str, Any], reason: str) -> None:
    with pytest.raises(BadInput, match=reason):
        from_arrays({**ARRAYS, **change}, "ball_seeking", FEATURES)


def test_what_is_no_fitted_tree_is_refused() -> None:
    with pytest.raises(BadInput, match="object: not a fitted decision tree"):
        from_sklearn(object(), "ball_seeking", FEATURES)


def test_without_scikit_learn_cart_says_what_to_do(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "sklearn", None)
    with pytest.raises(BadInput, match=r"needs scikit-learn.*pip install -r requirements/study.txt"):
        grow_cart("ball_seeking", scattered(20), 0, 3)


@pytest.mark.parametrize("seed", range(3))
def test_a_regressor_predicts_like_our_tree_on_random_points_and_on_every_threshold(seed: int) -> None:
    sklearn_tree = pytest.importorskip("sklearn.tree")
    patterns = scattered(400, seed)
    estimator = sklearn_tree.DecisionTreeRegressor(max_leaf_nodes=60, random_state=seed)
    estimator.fit(patterns.x, levels_of_classes(patterns.wheel_class) * LEVEL_RAD_S)
    tree = from_sklearn(estimator, "ball_seeking", FEATURES)
    assert tree.leaf_count == 60
    rng = np.random.default_rng(seed)
    x = np.array(edge_points(tree) + [(rng.uniform(0.0, 3.2), rng.uniform(-pi, pi)) for _ in range(2000)])
    assert (tree.references(x) == estimator.predict(x)).all()


def test_a_classifier_predicts_like_our_tree() -> None:
    sklearn_tree = pytest.importorskip("sklearn.tree")
    patterns = scattered(400)
    estimator = sklearn_tree.DecisionTreeClassifier(max_leaf_nodes=40, random_state=0)
    estimator.fit(patterns.x, patterns.wheel_class)
    tree = from_sklearn(estimator, "ball_seeking", FEATURES)
    x = np.array(edge_points(tree))
    assert (tree.references(x) == levels_of_classes(estimator.predict(x)) * LEVEL_RAD_S).all()
    with pytest.raises(BadInput, match="2 features; behavior 'ball_seeking' 1"):
        from_sklearn(estimator, "ball_seeking", FEATURES[:1])


def test_cart_has_the_leaves_it_was_asked_for_and_fits_better_with_more() -> None:
    pytest.importorskip("sklearn")
    patterns = scattered(300)
    trees = [grow_cart("ball_seeking", patterns, 0, leaves).tree for leaves in (1, 2, 40)]
    assert [tree.leaf_count for tree in trees] == [1, 2, 40]
    errors = [wheel_rmse(tree, patterns) for tree in trees]
    assert errors == sorted(errors, reverse=True)
    assert trees[2].origin["leaves"] == 40
    with pytest.raises(BadInput, match="a tree of 0 leaves"):
        grow_cart("ball_seeking", patterns, 0, 0)


def test_cross_validation_chooses_the_size_of_the_smallest_held_out_error() -> None:
    pytest.importorskip("sklearn")
    patterns = scattered(200)
    cart = grow_cart("ball_seeking", patterns, 3)
    assert set(cart.tried) == {leaves for leaves in LEAF_COUNTS if leaves <= 200}
    assert cart.tried[cart.tree.leaf_count] == min(cart.tried.values())
    assert cart.tried[8] == cross_validated_rmse(patterns, lambda part: grow_cart("ball_seeking", part, 3, 8).tree)
    assert cart.tree == grow_cart("ball_seeking", patterns, 3).tree
    one = patterns.select(patterns.demonstration == 0)
    assert grow_cart("ball_seeking", one, 3).tree.leaf_count == 1


@pytest.mark.parametrize("objective", ["printed", "weighted"])
def test_the_value_of_the_planned_tree_is_the_planned_value_and_no_other_tree_is_worth_more(objective: str) -> None:
    patterns = scattered(150)
    parameters = InductionParameters(method="dp", objective=objective, min_range=1 / 16, discount=0.9)
    planned = induce("ball_seeking", patterns, parameters, 0)
    assert tree_value(planned.tree, patterns, parameters) == pytest.approx(planned.value, abs=1e-9)
    few = induce("ball_seeking", patterns, InductionParameters(objective=objective, min_range=1 / 16, trials=2), 0)
    assert tree_value(few.tree, patterns, parameters) < planned.value


def test_splits_that_part_nothing_are_worth_their_cost() -> None:
    patterns = scattered(50)
    tree = from_arrays({**ARRAYS, "threshold": [3.1999, -2, 3.1, -2, -2]}, "ball_seeking", FEATURES)
    assert tree_value(tree, patterns, InductionParameters(split_cost=-0.25, discount=0.5)) == pytest.approx(
        -0.25 - 0.125
    )
