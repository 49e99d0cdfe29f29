"""Induction against a slow recursion that is written as the paper reads: every box, every equation, every leaf."""

from __future__ import annotations

from dataclasses import replace

import induction_oracle as oracle
import numpy as np
import pytest
from fbql_behaviors.core.boxes import Boxes, find_boxes
from fbql_behaviors.core.equations import (
    children_value,
    entropy,
    information_gain,
    q_update,
    q_update_printed,
    split_reward,
)
from fbql_behaviors.core.induction import InductionParameters, induce, learn, plan
from fbql_behaviors.core.quantizer import levels_of, rad_s_of, wheel_class_of
from fbql_common.core.field import MAX_WHEEL_RAD_S
from hypothesis import given, settings
from hypothesis import strategies as st
from tree_strategies import BEARINGS, DISTANCES, PLANE, patterns_of_rows, rows

HALVINGS = 3
OBJECTIVES = pytest.mark.parametrize("objective", ["printed", "weighted"])
EXPLORING = InductionParameters(
    min_range=1 / 2**HALVINGS, trials=4000, epsilon_start=1.0, epsilon_end=1.0, split_cost=-0.02, discount=0.9
)
"""All actions are random, so that every box is visited again and again, not only those of the best tree."""
CLASSES = st.lists(st.integers(0, 5), min_size=1, max_size=30)
REALS = st.floats(-100.0, 100.0)
ROWS = rows([0, 100, 420, 840], max_size=16)


def limits_of(parameters: InductionParameters) -> oracle.Limits:
    return oracle.Limits(
        tuple((feature.low, feature.high) for feature in PLANE),
        parameters.objective,
        parameters.split_cost,
        parameters.discount,
        parameters.min_range,
        parameters.min_patterns,
        parameters.min_half_patterns,
        parameters.max_entropy,
    )


def numbered(boxes: Boxes) -> dict[oracle.Box, int]:
    """The number of each box."""
    return {
        tuple(zip(levels, index, strict=True)): box
        for box, (levels, index) in enumerate(zip(boxes.levels.tolist(), boxes.index.tolist(), strict=True))
    }


def drawn(seed: int, n: int = 40) -> list[oracle.Row]:
    """Random patterns whose class tells the quarter they lie in, one time in four it does not."""
    rng = np.random.default_rng(seed)
    data: list[oracle.Row] = []
    for distance, bearing, chance in rng.random((n, 3)).tolist():
        wheel_class = 2 * (distance > 0.4) + (bearing > 0.6) if chance > 0.25 else int(rng.integers(4))
        data.append((3.2 * distance, 6.0 * bearing - 3.0, int(wheel_class)))
    return data


@OBJECTIVES
@settings(max_examples=40)
@given(
    data=ROWS,
    split_cost=st.sampled_from([0.0, -0.02, -0.2]),
    min_patterns=st.integers(2, 6),
    min_half_patterns=st.integers(1, 4),
    max_entropy=st.sampled_from([0.0, 0.3]),
)
def test_planning_finds_the_literal_value_of_every_box(
    objective: str,
    data: list[oracle.Row],
    split_cost: float,
    min_patterns: int,
    min_half_patterns: int,
    max_entropy: float,
) -> None:
    parameters = replace(
        EXPLORING,
        objective=objective,
        split_cost=split_cost,
        min_patterns=min_patterns,
        min_half_patterns=min_half_patterns,
        max_entropy=max_entropy,
    )
    boxes = find_boxes(patterns_of_rows(data), (HALVINGS, HALVINGS))
    found, box_of = plan(boxes, parameters).values, numbered(boxes)
    for box, value in oracle.values(data, limits_of(parameters)).items():
        assert found[box_of[box]] == pytest.approx(value, abs=1e-9)


@OBJECTIVES
@pytest.mark.parametrize(
    ("optimism", "learning_rate", "seed"), [(0.0, 1.0, 1), (0.0, 0.3, 2), (0.5, 1.0, 2), (0.5, 0.3, 1)]
)
def test_learned_q_of_every_box_converges_to_the_literal_value_within_1_percent_of_the_root(
    objective: str, optimism: float, learning_rate: float, seed: int
) -> None:
    parameters = replace(EXPLORING, objective=objective, optimism=optimism, learning_rate=learning_rate)
    data = drawn(seed)
    boxes = find_boxes(patterns_of_rows(data), (HALVINGS, HALVINGS))
    learned, box_of = learn(boxes, parameters, np.random.default_rng(seed)).values, numbered(boxes)
    expected = oracle.values(data, limits_of(parameters))
    root_value = expected[oracle.root(limits_of(parameters))]
    assert root_value > 0.1
    assert len(expected) > 30
    assert sum(value > 0.0 for value in expected.values()) > 10
    for box, value in expected.items():
        assert learned[box_of[box]] == pytest.approx(value, abs=0.01 * root_value)


def test_few_trials_have_not_converged() -> None:
    data = drawn(1)
    boxes = find_boxes(patterns_of_rows(data), (HALVINGS, HALVINGS))
    exact = plan(boxes, EXPLORING).value
    few = learn(boxes, replace(EXPLORING, trials=3, optimism=0.0), np.random.default_rng(1)).value
    assert few < 0.99 * exact


@given(CLASSES)
def test_entropy_of_any_classes_is_the_literal_sum(classes: list[int]) -> None:
    assert entropy([classes.count(each) for each in range(6)]) == pytest.approx(oracle.entropy_of(classes), abs=1e-12)


@given(CLASSES, CLASSES)
def test_gain_of_any_split_is_the_literal_one_and_never_negative(left: list[int], right: list[int]) -> None:
    parts = [[part.count(each) for each in range(6)] for part in ([*left, *right], left, right)]
    gain = information_gain(*(entropy(part) for part in parts), float(len(left)), float(len(right)))
    assert gain == pytest.approx(oracle.gain_of([*left, *right], left, right), abs=1e-12)
    assert gain > -1e-12


@given(REALS, REALS, REALS, REALS, st.floats(0.0, 1.0), st.floats(0.0, 1.0))
def test_eq_3_and_4_of_any_numbers_are_the_printed_formulas(
    q: float, gain: float, left: float, right: float, alpha: float, gamma: float
) -> None:
    reward = split_reward(-0.25, gain)
    assert reward == -0.25 + gain
    target = reward + gamma * children_value(left, right, 0.5)
    as_printed = q + alpha * (reward + gamma * (left + right) / 2)
    assert q_update_printed(q, target, alpha) == pytest.approx(as_printed, abs=1e-9)
    assert q_update(q, target, alpha) == pytest.approx(as_printed - alpha * q, abs=1e-9)


@OBJECTIVES
@settings(max_examples=40)
@given(data=ROWS, point=st.tuples(DISTANCES, BEARINGS))
def test_leaves_of_an_induced_tree_tile_the_root_and_hold_a_point_once(
    objective: str, data: list[oracle.Row], point: tuple[float, float]
) -> None:
    parameters = replace(EXPLORING, method="dp", objective=objective, split_cost=0.0)
    tree = induce("ball_seeking", patterns_of_rows(data), parameters, 0).tree
    regions = tree.regions()
    assert sum((a[1] - a[0]) * (b[1] - b[0]) for a, b in regions) == pytest.approx(3.2 * 6.0)
    holding = [
        leaf_id
        for leaf_id, region in enumerate(regions)
        if all(low <= x < high for x, (low, high) in zip(point, region, strict=True))
    ]
    assert holding == [tree.answer(point)[0]]
    for leaf, (a, b) in zip(tree.leaves, regions, strict=True):
        assert leaf.patterns == sum(a[0] <= row[0] < a[1] and b[0] <= row[1] < b[1] for row in data)


@settings(max_examples=30)
@given(*[st.floats(-MAX_WHEEL_RAD_S, MAX_WHEEL_RAD_S)] * 2)
def test_class_of_any_wheel_pair_is_the_nearest_of_all_841(left_rad_s: float, right_rad_s: float) -> None:
    def distance(wheel_class: int) -> float:
        left, right = levels_of(wheel_class)
        return abs(rad_s_of(left) - left_rad_s) + abs(rad_s_of(right) - right_rad_s)

    nearest = min(distance(wheel_class) for wheel_class in range(841))
    assert distance(wheel_class_of(left_rad_s, right_rad_s)) == pytest.approx(nearest, abs=1e-9)
