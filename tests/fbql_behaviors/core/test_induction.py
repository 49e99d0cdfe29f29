"""Induction: the value of its trees, the stop criteria, odd data. test_oracle.py has the literal recursion."""

from __future__ import annotations

from dataclasses import fields, replace
from math import inf, isfinite, nan

import numpy as np
import pytest
from fbql_behaviors.core.boxes import Boxes, find_boxes
from fbql_behaviors.core.equations import entropy
from fbql_behaviors.core.induction import InductionParameters, induce, learn, plan, split_rewards
from fbql_behaviors.core.patterns import Patterns
from fbql_behaviors.core.quantizer import levels_of, rad_s_of
from fbql_behaviors.core.tree import Split, Tree
from fbql_common.core.errors import BadInput
from hypothesis import given
from hypothesis import strategies as st
from tree_strategies import PLANE, Row, patterns_of_rows, rows

DP = InductionParameters(method="dp", min_range=1 / 8)
OBJECTIVES = pytest.mark.parametrize("objective", ["printed", "weighted"])
ROWS = rows([0, 100, 420, 840], max_size=25)


def scattered(n: int, seed: int = 0) -> Patterns:
    """Random attributes; the class tells the quarter they lie in, one time in five it does not."""
    rng = np.random.default_rng(seed)
    x = np.stack((rng.uniform(0.0, 3.2, n), rng.uniform(-3.0, 3.0, n)), axis=1)
    wheel_class = 100 * (x[:, 0] > 1.1) + 50 * (x[:, 1] > 0.3)
    wheel_class = np.where(rng.random(n) < 0.2, rng.integers(0, 841, n), wheel_class)
    return Patterns(PLANE, x, wheel_class.astype(np.int64), np.arange(n))


def value_of_splits(boxes: Boxes, split: list[int], parameters: InductionParameters, box: int = 0) -> float:
    """What the tree that follows `split` is worth, counted reward by reward."""
    if split[box] < 0:
        return 0.0
    reward, _ = split_rewards(boxes, parameters)
    share = 0.5 if parameters.objective == "printed" else 1.0
    left, right = boxes.left[box, split[box]], boxes.right[box, split[box]]
    below = value_of_splits(boxes, split, parameters, left) + value_of_splits(boxes, split, parameters, right)
    return float(reward[box, split[box]]) + parameters.discount * share * below


@OBJECTIVES
def test_the_planned_tree_is_worth_the_planned_value(objective: str) -> None:
    parameters = replace(DP, objective=objective)
    boxes = find_boxes(scattered(60), (3, 3))
    planned = plan(boxes, parameters)
    assert value_of_splits(boxes, planned.split, parameters) == pytest.approx(planned.value)


@given(data=ROWS, split_cost=st.sampled_from([0.0, -0.02, -0.2]))
def test_the_weighted_value_is_the_entropy_that_is_removed_less_the_cost_of_the_splits(
    data: list[Row], split_cost: float
) -> None:
    patterns = patterns_of_rows(data)
    found = induce("ball_seeking", patterns, replace(DP, split_cost=split_cost), 0)
    leaf_ids = found.tree.leaf_ids(patterns.x)
    left_over = 0.0
    for leaf_id in range(found.tree.leaf_count):
        classes = patterns.wheel_class[leaf_ids == leaf_id]
        left_over += len(classes) / len(data) * entropy(np.unique(classes, return_counts=True)[1].tolist())
    removed = entropy(np.unique(patterns.wheel_class, return_counts=True)[1].tolist()) - left_over
    assert found.value == pytest.approx(removed + split_cost * (found.tree.leaf_count - 1), abs=1e-9)


@OBJECTIVES
def test_the_learned_tree_is_worth_the_planned_value(objective: str) -> None:
    parameters = InductionParameters(
        objective=objective, min_range=1 / 8, trials=2000, learning_rate=0.3, epsilon_start=0.5
    )
    boxes = find_boxes(scattered(120), (3, 3))
    learned, planned = learn(boxes, parameters, np.random.default_rng(0)), plan(boxes, parameters)
    assert learned.value == pytest.approx(planned.value, rel=0.01)
    assert value_of_splits(boxes, learned.split, parameters) == pytest.approx(planned.value, rel=0.01)
    assert len(learned.curve) == 2000
    assert all(map(isfinite, learned.curve))


def test_the_update_as_printed_diverges() -> None:
    boxes = find_boxes(scattered(120), (3, 3))
    parameters = InductionParameters(objective="printed", update="printed", learning_rate=0.5, trials=200)
    value = learn(boxes, parameters, np.random.default_rng(0)).value
    assert value > 1000 * plan(boxes, parameters).value


def test_a_single_trial_explores_as_the_first_one() -> None:
    parameters = InductionParameters(epsilon_start=1.0, epsilon_end=0.0, trials=1)
    boxes = find_boxes(scattered(60), (3, 3))
    once, again = (
        learn(boxes, each, np.random.default_rng(2)).value
        for each in (parameters, replace(parameters, epsilon_end=1.0))
    )
    assert once == again


def test_the_same_seed_gives_the_same_tree_and_the_origin_tells_the_seed() -> None:
    parameters = InductionParameters(epsilon_start=0.9, optimism=0.0, trials=5)
    trees = [induce("ball_seeking", scattered(300), parameters, seed).tree for seed in (3, 3, 4)]
    assert trees[0] == trees[1]
    assert trees[0].hash == trees[1].hash
    assert trees[0].nodes != trees[2].nodes
    assert trees[0].origin["seed"] == 3
    assert trees[0].origin["patterns_sha256"] == scattered(300).sha256


def test_leaves_hold_the_mean_of_the_quantized_velocities_of_their_patterns() -> None:
    patterns = scattered(200)
    tree = induce("ball_seeking", patterns, DP, 0).tree
    leaf_ids = tree.leaf_ids(patterns.x)
    for leaf_id, leaf in enumerate(tree.leaves):
        classes = patterns.wheel_class[leaf_ids == leaf_id].tolist()
        assert leaf.patterns == len(classes)
        assert leaf.left_rad_s == pytest.approx(np.mean([rad_s_of(levels_of(each)[0]) for each in classes]))
        assert leaf.right_rad_s == pytest.approx(np.mean([rad_s_of(levels_of(each)[1]) for each in classes]))


def inner_counts(tree: Tree, patterns: Patterns) -> list[int]:
    """Patterns of every node that is split."""
    leaf_ids = tree.leaf_ids(patterns.x)

    def leaves_below(node: int) -> list[int]:
        found = tree.nodes[node]
        return leaves_below(found.left) + leaves_below(found.right) if isinstance(found, Split) else [found]

    return [
        int(np.isin(leaf_ids, leaves_below(index)).sum())
        for index, node in enumerate(tree.nodes)
        if isinstance(node, Split)
    ]


def test_a_region_with_too_few_patterns_is_not_split() -> None:
    patterns = scattered(200)
    counts = inner_counts(
        induce("ball_seeking", patterns, replace(DP, min_patterns=30, split_cost=0.0), 0).tree, patterns
    )
    assert counts
    assert min(counts) >= 30


def test_no_leaf_is_narrower_than_the_smallest_range() -> None:
    tree = induce("ball_seeking", scattered(500), replace(DP, min_range=1 / 4, split_cost=0.0), 0).tree
    assert tree.leaf_count > 4
    for region in tree.regions():
        for (low, high), feature in zip(region, PLANE, strict=True):
            assert high - low >= (feature.high - feature.low) / 4 * (1 - 1e-12)


@pytest.mark.parametrize("method", ["rl", "dp"])
def test_a_split_that_is_worth_nothing_is_not_made(method: str) -> None:
    """Both halves hold what the whole does, and can't be split again."""
    patterns = patterns_of_rows([(0.5, 0.5, 0), (0.5, 0.5, 1), (2.0, 0.5, 0), (2.0, 0.5, 1)])
    parameters = InductionParameters(method=method, split_cost=0.0, min_range=1 / 2)
    found = induce("ball_seeking", patterns, parameters, 0)
    assert (found.tree.leaf_count, found.value) == (1, 0.0)


@pytest.mark.parametrize(("excess", "as_range"), [(0.5e-9, 1 / 8), (0.8e-9, 1 / 4)])
def test_a_smallest_range_is_a_power_of_two_where_it_misses_it_by_a_rounding(excess: float, as_range: float) -> None:
    parameters = replace(DP, split_cost=0.0, min_range=(1 + excess) / 8)
    trees = [
        induce("ball_seeking", scattered(200), each, 0).tree
        for each in (parameters, replace(parameters, min_range=as_range))
    ]
    assert trees[0].nodes == trees[1].nodes


def test_without_optimism_and_chance_no_split_is_ever_tried() -> None:
    parameters = InductionParameters(optimism=0.0, epsilon_start=0.0, trials=3, min_range=1 / 8)
    learned = learn(find_boxes(scattered(60), (3, 3)), parameters, np.random.default_rng(0))
    assert learned.curve == [0.0] * 3
    assert set(learned.split) == {-1}


def test_a_trial_draws_once_for_each_box_that_offers_a_split() -> None:
    """Here the root alone, which a trial of chance splits for a draw in the upper half; each time it learns a half more."""
    boxes = find_boxes(patterns_of_rows([(0.5, 0.5, 0), (2.0, 0.5, 1)]), (1, 0))
    parameters = InductionParameters(
        optimism=0.0, epsilon_start=1.0, epsilon_end=1.0, learning_rate=0.5, trials=40, split_cost=0.0
    )
    learned = learn(boxes, parameters, np.random.default_rng(5))
    splits = np.cumsum(np.random.default_rng(5).random(40) >= 0.5)
    assert learned.curve == pytest.approx((np.log(2.0) * (1.0 - 0.5**splits)).tolist())


def test_every_leaf_holds_as_many_patterns_as_a_half_has_to() -> None:
    patterns = scattered(200)
    leaves = {}
    for fewest in (1, 12):
        tree = induce("ball_seeking", patterns, replace(DP, split_cost=0.0, min_half_patterns=fewest), 0).tree
        leaves[fewest] = [leaf.patterns for leaf in tree.leaves]
    assert 1 <= min(leaves[1]) < 12 <= min(leaves[12])
    assert len(leaves[12]) > 1


def test_the_origin_tells_every_parameter_that_a_tree_depends_on() -> None:
    """A default that came later is left out: trees that were made before it keep their hash."""
    later = {"min_half_patterns"}
    names = {field.name for field in fields(InductionParameters)}
    origin = induce("ball_seeking", scattered(50), DP, 0).tree.origin
    assert names & set(origin) == names - later
    assert (
        induce("ball_seeking", scattered(50), replace(DP, min_half_patterns=3), 0).tree.origin["min_half_patterns"] == 3
    )


def test_a_region_that_is_pure_enough_is_not_split() -> None:
    patterns = scattered(200)
    assert induce("ball_seeking", patterns, replace(DP, max_entropy=9.0), 0).tree.leaf_count == 1


def test_a_dearer_split_makes_a_smaller_tree() -> None:
    patterns = scattered(400)
    leaves = [
        induce("ball_seeking", patterns, replace(DP, split_cost=c), 0).tree.leaf_count for c in (-0.005, -0.05, -5.0)
    ]
    assert leaves[0] > leaves[1] > leaves[2] == 1


@pytest.mark.parametrize("method", ["rl", "dp"])
@OBJECTIVES
def test_one_pattern_makes_one_leaf(method: str, objective: str) -> None:
    """Fault 56."""
    found = induce(
        "ball_seeking", patterns_of_rows([(1.0, 0.5, 840)]), InductionParameters(method=method, objective=objective), 0
    )
    assert (found.tree.leaf_count, found.value) == (1, 0.0)
    assert found.tree.answer((1.0, 0.5)) == (0, 88.0, 88.0)


@pytest.mark.parametrize("method", ["rl", "dp"])
def test_patterns_of_one_class_make_one_leaf(method: str) -> None:
    """Fault 56."""
    rows = [(0.1 * k, 0.1 * k - 1.5, 420) for k in range(30)]
    assert induce("ball_seeking", patterns_of_rows(rows), InductionParameters(method=method), 0).tree.leaf_count == 1


@pytest.mark.parametrize("method", ["rl", "dp"])
@OBJECTIVES
def test_identical_patterns_of_different_classes_make_one_leaf_with_their_mean(method: str, objective: str) -> None:
    """Fault 58."""
    rows = [(1.0, 0.5, 0), (1.0, 0.5, 840)] * 10
    found = induce("ball_seeking", patterns_of_rows(rows), InductionParameters(method=method, objective=objective), 0)
    assert found.tree.leaf_count == 1
    assert found.tree.leaves[0][:2] == (0.0, 0.0)


def test_a_feature_that_never_changes_is_never_split() -> None:
    """Fault 57."""
    rows = [(1.0, 0.2 * k - 3.0, 29 * (k // 6)) for k in range(30)]
    tree = induce("ball_seeking", patterns_of_rows(rows), replace(DP, split_cost=0.0), 0).tree
    splits = [node.feature for node in tree.nodes if isinstance(node, Split)]
    assert splits
    assert set(splits) == {1}


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("method", "magic"),
        ("objective", "best"),
        ("split_cost", 0.5),
        ("split_cost", nan),
        ("discount", 1.5),
        ("min_range", 0.0),
        ("min_patterns", 1),
        ("min_half_patterns", 0),
        ("max_entropy", -1.0),
        ("trials", 0),
        ("learning_rate", 0.0),
        ("optimism", inf),
        ("epsilon_start", 2.0),
        ("update", "new"),
    ],
)
def test_a_parameter_out_of_range_is_refused_with_its_value(name: str, value: object) -> None:
    """Fault 62."""
    parameters = InductionParameters(**{name: value})  # pyright: ignore[reportArgumentType]
    with pytest.raises(BadInput, match=f"parameter '{name}' is .*{value}"):
        induce("ball_seeking", scattered(10), parameters, 0)


def test_the_gain_of_a_hand_made_split_is_that_of_the_hand() -> None:
    # distance splits (0, 0 | 1, 1) purely: gain ln 2; bearing splits (0, 1 | 0, 1): gain 0
    patterns = patterns_of_rows([(0.5, -1.0, 0), (0.5, 1.0, 0), (2.0, -1.0, 1), (2.0, 1.0, 1)])
    boxes = find_boxes(patterns, (1, 1))
    rewards, offered = split_rewards(boxes, InductionParameters(split_cost=-0.1, objective="printed"))
    assert rewards[0].tolist() == pytest.approx([0.5931471805599453, -0.1])
    assert offered[0].tolist() == [True, True]
    # the lower half of bearing holds one pattern of each class; as printed its gain counts whole, weighted a half
    half = int(boxes.left[0, 1])
    assert rewards[half, 0] == pytest.approx(0.5931471805599453)
    assert (offered[half].tolist(), rewards[half, 1]) == ([True, False], 0.0)
    weighted, _ = split_rewards(boxes, InductionParameters(split_cost=-0.1, objective="weighted"))
    assert weighted[half, 0] == pytest.approx(0.6931471805599453 / 2 - 0.1)
