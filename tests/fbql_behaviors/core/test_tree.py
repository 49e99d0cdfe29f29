"""Trees: half-open regions that tile the root, look-up, and everything a tree must not be."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable
from math import inf, nan, nextafter
from typing import Any

import numpy as np
import pytest
from fbql_behaviors.core.observation import Feature
from fbql_behaviors.core.tree import (
    CHANGED,
    MAX_AXES,
    MAX_FEATURE,
    MAX_LEVELS,
    CommandLeaf,
    Leaf,
    Node,
    Split,
    Tree,
    changed_leaf,
    check_space,
)
from fbql_common.core.command_space import Axis, CommandSpace
from fbql_common.core.errors import BadInput
from hypothesis import given
from hypothesis import strategies as st

FEATURES = (Feature("distance", "m", 0.0, 4.0), Feature("bearing", "rad", -2.0, 2.0))
LEAF = Leaf(1.0, 2.0, 3)


def tree_of(nodes: list[Node], leaves: int, features: tuple[Feature, ...] = FEATURES) -> Tree:
    return Tree("ball_seeking", features, tuple(nodes), tuple(Leaf(float(k), -float(k), k) for k in range(leaves)))


def small() -> Tree:
    """distance < 1: leaf 0 or 1 by bearing; else leaf 2."""
    return tree_of([Split(0, 1.0, 1, 4), Split(1, 0.0, 2, 3), 0, 1, 2], 3)


@st.composite
def trees(draw: st.DrawFn) -> Tree:
    nodes: list[Node] = []
    leaves = 0

    def grow(region: tuple[tuple[float, float], ...], depth: int) -> int:
        nonlocal leaves
        place = len(nodes)
        nodes.append(0)
        feature = draw(st.integers(0, 1))
        low, high = region[feature]
        if depth == 0 or high - low < 0.01 or draw(st.booleans()):
            nodes[place] = leaves
            leaves += 1
            return place
        threshold = low + (high - low) * draw(st.floats(0.1, 0.9))
        before, after = region[:feature], region[feature + 1 :]
        left = grow((*before, (low, threshold), *after), depth - 1)
        right = grow((*before, (threshold, high), *after), depth - 1)
        nodes[place] = Split(feature, threshold, left, right)
        return place

    grow(tuple((f.low, f.high) for f in FEATURES), 5)
    return tree_of(nodes, leaves)


POINTS = st.tuples(st.floats(0.0, 4.0, exclude_max=True), st.floats(-2.0, 2.0, exclude_max=True))


def test_a_split_point_belongs_to_the_right_child() -> None:
    tree = small()
    assert tree.answer((1.0, 0.0)) == (2, 2.0, -2.0)
    assert tree.answer((nextafter(1.0, 0.0), 0.0))[0] == 1
    assert tree.answer((0.5, -5e-324))[0] == 0


@given(trees(), POINTS)
def test_a_point_is_in_exactly_one_leaf_and_that_is_the_answer(tree: Tree, point: tuple[float, float]) -> None:
    inside = [
        leaf_id
        for leaf_id, region in enumerate(tree.regions())
        if all(low <= x < high for x, (low, high) in zip(point, region, strict=True))
    ]
    assert inside == [tree.answer(point)[0]]


@given(trees())
def test_the_leaves_tile_the_root_region(tree: Tree) -> None:
    areas = [(high - low) * (top - bottom) for (low, high), (bottom, top) in tree.regions()]
    assert sum(areas) == pytest.approx(16.0)


@given(trees(), st.lists(POINTS, min_size=1, max_size=20))
def test_many_observations_at_once_are_answered_like_each(tree: Tree, points: list[tuple[float, float]]) -> None:
    x = np.array(points)
    assert tree.leaf_ids(x).tolist() == [tree.answer(point)[0] for point in points]
    assert tree.references(x).tolist() == [list(tree.answer(point)[1:]) for point in points]


@given(trees(), st.tuples(st.floats(-9.0, 9.0), st.floats(-9.0, 9.0)))
def test_outside_of_the_root_region_the_answer_is_that_of_the_clamped_point(
    tree: Tree, point: tuple[float, float]
) -> None:
    clamped = tree.clamp(point)
    assert tree.contains(clamped)
    assert tree.answer(point) == tree.answer(clamped)
    assert tree.contains(point) == (clamped == point)


def test_the_upper_edge_of_the_root_region_is_outside_and_nan_is_nowhere() -> None:
    tree = small()
    assert tree.contains((0.0, -2.0))
    assert not tree.contains((4.0, 0.0))
    assert not tree.contains((nan, 0.0))


@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_the_root_region_contains_a_point_that_is_inside_in_every_feature(count: int) -> None:
    features = tuple(Feature(f"feature_{k}", "m", float(k), k + 1.0) for k in range(count))
    tree = tree_of([0], 1, features)
    inside = [k + 0.5 for k in range(count)]
    assert tree.contains(inside)
    for k in range(count):
        for value in (k - 0.5, k + 1.0, nan):
            assert not tree.contains([*inside[:k], value, *inside[k + 1 :]])


def test_the_hash_tells_any_difference() -> None:
    tree = small()
    assert tree.hash == small().hash
    assert len(tree.hash) == 64
    others = [
        Tree("other", FEATURES, tree.nodes, tree.leaves),
        Tree("ball_seeking", FEATURES, tree.nodes, (*tree.leaves[:2], LEAF)),
        Tree("ball_seeking", FEATURES, (tree.nodes[0], Split(1, 0.5, 2, 3), *tree.nodes[2:]), tree.leaves),
        Tree("ball_seeking", FEATURES, tree.nodes, tree.leaves, {"seed": 1}),
    ]
    assert len({tree.hash, *(other.hash for other in others)}) == 5


@pytest.mark.parametrize(
    ("nodes", "leaves", "reason"),
    [
        ([], 1, "at least one node"),
        ([0], 0, "at least one leaf"),
        ([Split(0, 1.0, 1, 2), 0], 1, "child index 2 is outside"),
        ([Split(0, 1.0, -1, 1), 0], 1, "child index -1 is outside"),
        ([Split(0, 1.0, 0, 1), 0], 1, "node 0 is reached twice: a cycle"),
        ([Split(0, 1.0, 1, 1), 0], 1, "node 1 is reached twice"),
        ([Split(0, 1.0, 1, 2), 0, 0], 1, "leaf_id 0 appears in two nodes"),
        ([Split(0, 1.0, 1, 2), 0, 2], 2, "leaf_id 2 is outside"),
        ([Split(0, 1.0, 1, 2), 0, 1], 3, "leaf_id 2 appears in no node"),
        ([0, 1], 2, "node 1 is not reached"),
        ([Split(2, 1.0, 1, 2), 0, 1], 2, "feature 2 is outside"),
        ([Split(0, nan, 1, 2), 0, 1], 2, "threshold nan is not inside"),
        ([Split(0, 0.0, 1, 2), 0, 1], 2, r"threshold 0.0 is not inside of its region \(0.0, 4.0\)"),
        ([Split(0, 4.0, 1, 2), 0, 1], 2, "threshold 4.0 is not inside"),
        (
            [Split(0, 1.0, 1, 2), Split(0, 2.0, 3, 4), 0, 1, 2],
            3,
            r"threshold 2.0 is not inside of its region \(0.0, 1.0\)",
        ),
    ],
)
def test_what_is_no_tree_is_refused_with_the_place(nodes: list[Node], leaves: int, reason: str) -> None:
    """Fault 38."""
    with pytest.raises(BadInput, match=reason):
        tree_of(nodes, leaves)


@pytest.mark.parametrize(("low", "high"), [(1.0, 1.0), (2.0, 1.0), (nan, 1.0), (0.0, inf)])
def test_a_feature_whose_low_is_not_below_its_high_is_refused(low: float, high: float) -> None:
    """Fault 38."""
    with pytest.raises(BadInput, match="must be below high"):
        tree_of([0], 1, (Feature("distance", "m", low, high),))


@pytest.mark.parametrize("leaf", [Leaf(nan, 0.0, 1), Leaf(0.0, 88.1, 1), Leaf(-inf, 0.0, 1), Leaf(0.0, 0.0, -1)])
def test_a_leaf_that_no_wheel_can_follow_is_refused(leaf: Any) -> None:
    with pytest.raises(BadInput, match="leaf 0: "):
        Tree("ball_seeking", FEATURES, (0,), (leaf,))


def test_a_tree_as_deep_as_a_chain_is_walked_without_recursion() -> None:
    depth = 3000
    features = (Feature("x", "m", 0.0, float(depth)),)
    nodes: list[Node] = []
    for k in range(depth - 1):
        nodes += [Split(0, float(k + 1), 2 * k + 1, 2 * k + 2), k]
    nodes.append(depth - 1)
    tree = Tree("chain", features, tuple(nodes), (LEAF,) * depth)
    assert tree.answer((2500.5,))[0] == 2500


@pytest.mark.parametrize(
    "copy_of", [copy.deepcopy, lambda tree: pickle.loads(pickle.dumps(tree))], ids=["copy", "pickle"]
)
def test_a_copy_of_a_tree_is_the_same_tree(copy_of: Callable[[Tree], Tree]) -> None:
    tree = Tree(
        "any", (Feature("x", "m", 0.0, 1.0),), (Split(0, 0.5, 1, 2), 0, 1), (Leaf(1, 2, 3), Leaf(4, 5, 6)), {"a": [1]}
    )
    other = copy_of(tree)
    assert other == tree
    assert (other.hash, other.origin) == (tree.hash, tree.origin)
    assert [other.answer([x]) for x in (0.2, 0.7)] == [(0, 1, 2), (1, 4, 5)]
    assert [other.contains([x]) for x in (0.2, 1.5)] == [True, False]


def test_a_tree_has_between_1_and_64_features_of_different_names() -> None:
    many = tuple(Feature(f"f{k}", "m", 0.0, 1.0) for k in range(64))
    assert tree_of([0], 1, many).leaf_count == 1
    for features, says in (
        ((), "a tree needs at least one feature"),
        ((*many, FEATURES[0]), "65 features; at most 64 are supported"),
        ((FEATURES[0], FEATURES[1], FEATURES[0]), "feature 'distance' occurs twice"),
    ):
        with pytest.raises(BadInput, match=says):
            tree_of([0], 1, features)


# Other commands than wheels

AXIS = Axis("linear.x", "m/s", -1.0, 1.0, 5)
TURNS = Axis("angular.z", "rad/s", 0.0, 2.0, 5)


def spaced(leaf: Any, *axes: Axis) -> Tree:
    return Tree("any", FEATURES, (0,), (leaf,), commands=CommandSpace(axes or (AXIS, TURNS)))


def test_a_command_space_has_1_to_6_axes_of_different_names_each_with_2_to_1001_levels_in_order() -> None:
    assert (MAX_AXES, MAX_LEVELS, MAX_FEATURE) == (6, 1001, 1e12)
    six = [AXIS._replace(name=f"axis {k}") for k in range(MAX_AXES)]
    for axes in (
        [AXIS],
        six,
        [AXIS._replace(levels=2)],
        [AXIS._replace(levels=MAX_LEVELS)],
        [AXIS._replace(low=-MAX_FEATURE, high=MAX_FEATURE)],
    ):
        check_space(CommandSpace(tuple(axes)))
    for axes, says in (
        ([], "1 to 6 axes"),
        ([*six, AXIS], "1 to 6 axes"),
        ([AXIS, AXIS], "with different names, not linear.x, linear.x"),
        ([AXIS._replace(levels=1)], "'linear.x': 1 levels; expected 2 to 1001"),
        ([AXIS._replace(levels=MAX_LEVELS + 1)], "1002 levels"),
        ([AXIS._replace(low=1.0)], "low 1.0 must be below high 1.0"),
        ([AXIS._replace(high=nextafter(MAX_FEATURE, inf))], "both within"),
        ([AXIS._replace(low=nextafter(-MAX_FEATURE, -inf))], "both within"),
        ([AXIS._replace(low=nan)], "must be below"),
    ):
        with pytest.raises(BadInput, match=says):
            check_space(CommandSpace(tuple(axes)))


def test_a_leaf_commands_every_axis_within_its_limits_which_belong_to_it() -> None:
    for command in ((-1.0, 0.0), (1.0, 2.0)):
        assert spaced(CommandLeaf(command, 0)).answer((1.0, 0.0)) == (0, *command)
    for leaf, says in (
        (CommandLeaf((0.0,), 1), "its command is not one of linear.x, angular.z"),
        (CommandLeaf((0.0, 0.0, 0.0), 1), "its command is not one of linear.x, angular.z"),
        (Leaf(0.0, 0.0, 1), "its command is not one of linear.x, angular.z"),
        (CommandLeaf((1.1, 0.0), 1), r"leaf 0: linear.x is 1.1, outside of \+-1 m/s"),
        (CommandLeaf((0.0, -0.1), 1), r"leaf 0: angular.z is -0.1, outside of \[0, 2\] rad/s"),
    ):
        with pytest.raises(BadInput, match=says):
            spaced(leaf)


def test_only_a_tree_of_wheels_has_leaves_of_wheels() -> None:
    assert small().wheel_leaves == small().leaves
    with pytest.raises(BadInput, match=r"commands linear.x, angular.z, not wheels; twist_behavior plays it"):
        _ = spaced(CommandLeaf((0.0, 0.0), 1)).wheel_leaves


def test_a_changed_leaf_has_the_new_command_and_the_tree_names_what_it_was_before_the_first_change() -> None:
    before = small()
    once = changed_leaf(before, 1, (5.0, -6.0))
    assert once.leaves == (before.leaves[0], Leaf(5.0, -6.0, before.leaves[1].patterns), before.leaves[2])
    assert once.origin == {
        "changed_from": before.hash, "changed_from_origin": {}, "method": CHANGED, "changed_leaves": [1],
    }  # fmt: skip
    twice = changed_leaf(once, 2, (0.0, 1.0))
    assert twice.leaves == (*once.leaves[:2], Leaf(0.0, 1.0, before.leaves[2].patterns))
    assert twice.origin == {**once.origin, "changed_leaves": [1, 2]}
    assert before == small(), "the tree given stays as it is"
    other = changed_leaf(spaced(CommandLeaf((0.0, 0.0), 7)), 0, (1.0, 2.0))
    assert other.leaves == (CommandLeaf((1.0, 2.0), 7),)
    with pytest.raises(BadInput, match="outside of"):
        changed_leaf(before, 0, (99.0, 0.0))
