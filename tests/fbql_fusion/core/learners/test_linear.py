"""Linear functions of binary features: numbers computed by hand, and slow literal oracles in plain Python."""

from __future__ import annotations

from math import log

import numpy as np
import pytest
from equation_oracles import gradient, literal_softmax, preference_lists
from fbql_fusion.core.learners.linear import (
    accumulate_td_errors,
    add_shared,
    add_to_rows,
    grow_table,
    log_weight_gradient,
    meetings,
    pairwise_sum,
    row_sum,
    row_sums,
    value_sums,
)
from hypothesis import given
from hypothesis import strategies as st


def test_a_value_is_the_sum_over_the_active_features() -> None:
    assert row_sum(np.array([[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]]), [0, 2]) == [6.0, 8.0]


def test_features_beyond_the_table_count_nothing_and_without_any_every_value_is_0() -> None:
    assert row_sum(np.array([[1.0, 2.0]]), [0, 1, 99]) == [1.0, 2.0]
    assert row_sum(np.zeros((0, 3)), [3]) == [0.0, 0.0, 0.0]
    assert row_sum(np.ones((4, 3)), []) == [0.0, 0.0, 0.0]


def test_the_gradient_pulls_the_driver_up_by_what_it_lacks() -> None:
    weights = np.array([[0.2, 0.8], [0.5, 0.5]])
    assert log_weight_gradient(weights, np.array([0, 1])) == pytest.approx(np.array([[0.8, -0.8], [-0.5, 0.5]]))
    assert weights.tolist() == [[0.2, 0.8], [0.5, 0.5]], "the weights given stay as they are"


@given(preference_lists(), st.data())
def test_the_step_towards_the_guide_is_the_gradient_of_the_log_of_the_drivers_weight(
    h: list[float], data: st.DataObject
) -> None:
    driver = data.draw(st.integers(0, len(h) - 1))
    found = log_weight_gradient(np.array([literal_softmax(h)]), np.array([driver]))
    assert found[0].tolist() == pytest.approx(gradient(lambda x: log(literal_softmax(x)[driver]), h), abs=1e-7)


def test_each_active_feature_takes_its_share_of_the_step() -> None:
    table = np.zeros((3, 2))
    add_shared(table, np.array([[0, 2]]), np.array([[4.0, -2.0]]), 0.5)
    assert table.tolist() == [[1.0, -0.5], [0.0, 0.0], [1.0, -0.5]]


def test_a_feature_of_several_decisions_takes_a_share_of_each() -> None:
    table = np.zeros((3, 1))
    add_shared(table, np.array([[0, 1], [1, 2]]), np.array([[4.0], [8.0]]), 0.5)
    assert table.tolist() == [[1.0], [3.0], [2.0]]


@st.composite
def minibatches(draw: st.DrawFn, highest_rate: float = 3.0) -> tuple[np.ndarray, float]:
    """Active features of some decisions, none twice in one, and a rate."""
    features = draw(st.integers(1, 4))
    row = st.lists(st.integers(0, 7), min_size=features, max_size=features, unique=True)
    return np.array(draw(st.lists(row, min_size=1, max_size=12))), draw(st.floats(0.01, highest_rate))


@given(minibatches(), st.integers(1, 3), st.integers(0, 1000))
def test_the_assignment_is_the_literal_loop(minibatch: tuple[np.ndarray, float], n: int, seed: int) -> None:
    active, rate = minibatch
    steps = np.random.default_rng(seed).normal(size=(len(active), n))
    rows: list[list[int]] = active.tolist()
    expected = [[0.0] * n for _ in range(8)]
    for row, step in zip(rows, steps.tolist(), strict=True):
        shared = sum(rate / len(row) for f in row for other in rows for g in other if f == g)
        for f in row:
            for i in range(n):
                expected[f][i] += rate / len(row) * step[i] / max(1.0, shared)
    table = np.zeros((8, n))
    add_shared(table, active, steps, rate)
    assert table == pytest.approx(np.array(expected), abs=1e-12)


@given(minibatches(), st.integers(0, 1000))
def test_no_minibatch_makes_values_diverge(minibatch: tuple[np.ndarray, float], seed: int) -> None:
    """What is left to learn shrinks, at any rate, however many features the decisions share."""
    active, rate = minibatch
    target = np.random.default_rng(seed).normal(size=8)[active].sum(axis=1)
    shared = [sum(rate / len(row) for f in row for other in active for g in other if f == g) for row in active]
    scale = np.maximum(shared, 1.0)
    value = np.zeros(8)
    before = (target**2 / scale).sum()
    for _ in range(20):
        error = target - value[active].sum(axis=1)
        left = (error**2 / scale).sum()
        assert left <= before + 1e-9
        before = left
        add_shared(value.reshape(-1, 1), active, error.reshape(-1, 1), rate)


@pytest.mark.parametrize("decisions", [1, 10, 128, 5000])
def test_a_robot_that_stands_still_reaches_its_value_and_does_not_overshoot(decisions: int) -> None:
    """In a deadlock every decision has the same features: at a rate of 0.1, 128 of them would move V 12.8 times too far."""
    active = np.tile(np.arange(6), (decisions, 1))
    value = np.zeros(6)
    add_shared(value.reshape(-1, 1), active, np.full((decisions, 1), 10.0), 0.1)
    assert value.sum() == pytest.approx(10.0 * min(1.0, 0.1 * decisions))


def test_without_decisions_there_is_nothing_to_assign() -> None:
    table = np.ones((5, 2))
    add_shared(table, np.zeros((0, 3), dtype=np.int64), np.zeros((0, 2)), 0.1)
    assert (table == 1.0).all()


def test_without_features_there_is_nothing_to_assign() -> None:
    table = np.ones((2, 2))
    add_shared(table, np.zeros((3, 0), dtype=np.int64), np.ones((3, 2)), 0.1)
    assert table.tolist() == [[1.0, 1.0], [1.0, 1.0]]


def test_a_table_that_is_too_short_doubles_and_keeps_its_rows() -> None:
    table = np.arange(6.0).reshape(3, 2)
    assert grow_table(table, 3) is table
    assert grow_table(table, 4).tolist() == [*table.tolist(), [0.0, 0.0], [0.0, 0.0], [0.0, 0.0]]


# Kernels: what is compiled is the loop, and has NumPy's bits


@pytest.mark.parametrize("n", [*range(19), 42, 127, 128, 129, 136, 137, 500, 1031, 5000])
def test_a_sum_has_the_bits_of_numpys(n: int) -> None:
    for seed in range(5):
        values = np.random.default_rng(seed).normal(size=n) * 10.0 ** np.random.default_rng(seed + 5).integers(-8, 8, n)
        assert pairwise_sum.function(values) == np.add.reduce(values) == pairwise_sum.interpreted(values)


@given(minibatches(), st.integers(1, 9), st.integers(0, 1000))
def test_each_loop_has_the_bits_of_its_numpy_form(minibatch: tuple[np.ndarray, float], n: int, seed: int) -> None:
    active = minibatch[0]
    rng = np.random.default_rng(seed)
    table, value, shares = rng.normal(size=(8, n)), rng.normal(size=8), rng.normal(size=(len(active), n))
    assert row_sums.function(table, active).tobytes() == row_sums.interpreted(table, active).tobytes()
    assert value_sums.function(value, active).tobytes() == value_sums.interpreted(value, active).tobytes()
    assert meetings.function(active).tolist() == meetings.interpreted(active).tolist()
    one, other = table.copy(), table.copy()
    add_to_rows.function(one, active, shares)
    add_to_rows.interpreted(other, active, shares)
    assert one.tobytes() == other.tobytes() != table.tobytes()
    td_errors, discounts = rng.normal(size=n), rng.random(n)
    for trace in (0.0, 0.7, 1.0):
        looped = accumulate_td_errors.function(td_errors, discounts, trace)
        assert looped.tobytes() == accumulate_td_errors.interpreted(td_errors, discounts, trace).tobytes()


def test_each_td_error_is_followed_by_a_decayed_share_of_the_later_ones() -> None:
    errors, discounts = np.array([1.0, 2.0, 4.0]), np.array([0.5, 0.25, 0.125])
    for accumulate in (accumulate_td_errors.function, accumulate_td_errors.interpreted):
        last, middle = 4.0, 2.0 + 0.25 * 0.5 * 4.0
        assert accumulate(errors, discounts, 0.5).tolist() == [1.0 + 0.5 * 0.5 * middle, middle, last]
        assert accumulate(errors[:0], discounts[:0], 0.5).tolist() == []
