"""Equations 16 to 20: numbers computed by hand, and slow literal oracles in plain Python."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import exp, log
from typing import NamedTuple

import numpy as np
import pytest
from fbql_fusion.core.learners.value import equations as eq
from hypothesis import assume, given
from hypothesis import strategies as st

shares = st.floats(0, 1)
temperatures = st.floats(0.05, 5)
thetas = st.lists(st.floats(-3, 3), min_size=1, max_size=5)


def literal_weights(theta: Sequence[float], temperature: float, exploration: float) -> list[float]:
    total = sum(exp(x / temperature) for x in theta)
    return [(1 - exploration) * exp(x / temperature) / total + exploration / len(theta) for x in theta]


# Eq. 16


def test_weights_are_in_proportion_to_the_powers_of_theta_over_tau_and_a_share_of_them_is_equal() -> None:
    assert eq.soft_weights([0.0, log(3.0)], 1.0, 0.0) == pytest.approx((0.25, 0.75), abs=1e-15)
    assert eq.soft_weights([0.0, 2 * log(3.0)], 2.0, 0.0) == pytest.approx((0.25, 0.75), abs=1e-15)
    assert eq.soft_weights([0.0, log(3.0)], 1.0, 0.4) == pytest.approx((0.6 * 0.25 + 0.2, 0.6 * 0.75 + 0.2), abs=1e-15)
    assert eq.soft_weights([7.0], 0.1, 0.3) == pytest.approx((1.0,), abs=1e-15)


@given(thetas, temperatures, shares, st.floats(-600, 600))
def test_weights_are_the_literal_ones_and_stay_when_all_of_theta_shifts(
    theta: list[float], temperature: float, exploration: float, shift: float
) -> None:
    weights = eq.soft_weights(theta, temperature, exploration)
    assert weights == pytest.approx(literal_weights(theta, temperature, exploration), abs=1e-12)
    assert sum(weights) == pytest.approx(1.0, abs=1e-12)
    assert min(weights) >= exploration / len(theta) - 1e-15
    assert eq.soft_weights([x + shift for x in theta], temperature, exploration) == pytest.approx(weights, abs=1e-9)


def test_values_far_apart_do_not_overflow() -> None:
    assert eq.soft_weights([-1e4, 1e4], 1e-3, 0.1) == pytest.approx((0.05, 0.95))


@given(thetas, st.floats(-9, 9), temperatures, shares)
def test_q_in_the_place_of_theta_gives_the_same_weights(
    theta: list[float], shared: float, temperature: float, exploration: float
) -> None:
    weights = eq.soft_weights(theta, temperature, exploration)
    q = eq.values_of(theta, shared, weights)
    assert eq.soft_weights(q, temperature, exploration) == pytest.approx(weights, abs=1e-12)


# Eq. 17


def test_q_is_what_the_state_is_worth_and_what_a_behavior_is_worth_beside_the_others() -> None:
    # U 5, and theta less its mean 0.25 * 2 + 0.75 * 6 = 5.
    assert eq.values_of([2.0, 6.0], 5.0, (0.25, 0.75)) == (2.0, 6.0)
    assert eq.values_of([2.0, 6.0], 8.0, (0.25, 0.75)) == (5.0, 9.0)


@given(thetas, st.floats(-9, 9), temperatures, shares)
def test_the_weighted_sum_of_q_is_u_and_its_differences_are_those_of_theta(
    theta: list[float], shared: float, temperature: float, exploration: float
) -> None:
    weights = eq.soft_weights(theta, temperature, exploration)
    q = eq.values_of(theta, shared, weights)
    assert sum(w * x for w, x in zip(weights, q, strict=True)) == pytest.approx(shared, abs=1e-12)
    for i in range(len(theta)):
        assert q[i] - q[0] == pytest.approx(theta[i] - theta[0], abs=1e-12)


@given(st.integers(1, 4), st.integers(1, 6), temperatures, shares, st.integers(0, 1000))
def test_weights_and_q_of_many_situations_are_those_of_each(
    n: int, situations: int, temperature: float, exploration: float, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    theta, shared = rng.normal(size=(situations, n)), rng.normal(size=situations)
    masks = rng.random((situations, n)) < 0.6
    masks[np.arange(situations), rng.integers(0, n, situations)] = True
    weights = eq.soft_weights_of_all(theta, temperature, exploration, masks)
    q = eq.values_of_all(theta, shared, weights)
    assert weights.shape == q.shape == (situations, n)
    every = (theta, shared, masks, weights, q)
    for row, u, mask, ws, qs in zip(*(each.tolist() for each in every), strict=True):
        one = eq.soft_weights(row, temperature, exploration, mask)
        others = iter(literal_weights([x for x, may in zip(row, mask, strict=True) if may], temperature, exploration))
        assert one == pytest.approx([next(others) if may else 0.0 for may in mask], abs=1e-9)
        assert ws == pytest.approx(one, abs=1e-12)
        assert qs == pytest.approx(eq.values_of(row, u, one), abs=1e-12)


# Eq. 18


def test_what_decays_is_halfway_at_its_half_time_and_a_quarter_from_its_end_at_three_of_them() -> None:
    assert [eq.decayed(5.0, 1.0, 300.0, e) for e in (0, 300, 900)] == [5.0, 3.0, 2.0]


@given(st.floats(-5, 5), st.floats(-5, 5), st.floats(0.001, 1e6), st.integers(0, 10**6), st.integers(0, 10**6))
def test_what_decays_goes_from_first_towards_last_and_never_back(
    first: float, last: float, halving: float, early: int, later: int
) -> None:
    assume(early <= later)
    before, after = (eq.decayed(first, last, halving, e) for e in (early, later))
    assert abs(after - last) <= abs(before - last) + 1e-12 <= abs(first - last) + 2e-12


# Eqs. 19 and 20: the learning targets


def targets(rewards: list[float], discounts: list[float], drivers: list[int], q: list[list[float]],
          weights: list[list[float]], trace: float) -> list[float]:  # fmt: skip
    """`lambda_returns`, of lists."""
    found = eq.lambda_returns(
        np.array(rewards), np.array(discounts), np.array(drivers), np.array(q), np.array(weights), trace
    )
    return found.tolist()


def test_the_driver_takes_the_whole_reward_and_what_is_to_be_expected_next() -> None:
    # sum_j w Q of s' is 0.25 * 4 + 0.75 * 8 = 7: G = 3 + 0.5 * 7, whichever of the two drove and whatever its weight.
    q, weights = [[1.0, 2.0], [4.0, 8.0]], [[0.1, 0.9], [0.25, 0.75]]
    assert targets([3.0], [0.5], [0], q, weights, 0.7) == [6.5]
    assert targets([3.0], [0.5], [1], q, weights, 0.7) == [6.5]


def test_a_later_td_error_counts_decayed() -> None:
    # d_1 = 10 + 0.5 * 0 - 2 = 8 (terminated: the last row is 0) and d_0 = 0 + 0.5 * (0.5 * 2 + 0.5 * 6) - 1 = 1;
    # E_0 = 1 + 0.5 * 0.5 * 8 = 3.
    q, weights = [[1.0, 9.0], [6.0, 2.0], [0.0, 0.0]], [[0.5, 0.5]] * 3
    assert targets([0.0, 10.0], [0.5, 0.5], [0, 1], q, weights, 0.5) == [1.0 + 3.0, 2.0 + 8.0]


class Experience(NamedTuple):
    """An episode of T decisions and what was expected in it."""

    rewards: list[float]
    discounts: list[float]
    drivers: list[int]
    q: list[list[float]]
    weights: list[list[float]]


@st.composite
def episodes(draw: st.DrawFn) -> Experience:
    n, length = draw(st.integers(1, 4)), draw(st.integers(1, 7))
    rng = np.random.default_rng(draw(st.integers(0, 10**6)))
    weights = rng.dirichlet(np.ones(n), length + 1)
    q = 5.0 * rng.normal(size=(length + 1, n))
    if draw(st.booleans()):
        q[-1] = 0.0
    return Experience(
        (4.0 * rng.normal(size=length)).tolist(),
        rng.random(length).tolist(),
        rng.integers(0, n, length).tolist(),
        q.tolist(),
        weights.tolist(),
    )


@given(episodes(), shares)
def test_lambda_returns_are_the_double_sum_of_their_definition(lived: Experience, trace: float) -> None:
    expected: list[float] = []
    for t, driver in enumerate(lived.drivers):
        total = lived.q[t][driver]
        for later in range(t, len(lived.drivers)):
            share = 1.0
            for between in range(t, later):
                share *= lived.discounts[between] * trace
            bootstrap = sum(w * x for w, x in zip(lived.weights[later + 1], lived.q[later + 1], strict=True))
            own = lived.q[later][lived.drivers[later]]
            total += share * (lived.rewards[later] + lived.discounts[later] * bootstrap - own)
        expected.append(total)
    assert targets(*lived, trace) == pytest.approx(expected, abs=1e-9)


@given(episodes())
def test_without_a_trace_the_target_is_eq_5s_with_the_whole_reward(lived: Experience) -> None:
    found = targets(*lived, 0.0)
    for t, target in enumerate(found):
        bootstrap = sum(w * x for w, x in zip(lived.weights[t + 1], lived.q[t + 1], strict=True))
        assert target == pytest.approx(lived.rewards[t] + lived.discounts[t] * bootstrap, abs=1e-9)


@given(episodes(), shares)
def test_what_was_expected_and_comes_is_no_td_error(lived: Experience, trace: float) -> None:
    """Rewards by which every decision is worth just what it was thought to be."""
    rewards: list[float] = []
    for t, driver in enumerate(lived.drivers):
        bootstrap = sum(w * x for w, x in zip(lived.weights[t + 1], lived.q[t + 1], strict=True))
        rewards.append(lived.q[t][driver] - lived.discounts[t] * bootstrap)
    found = targets(*lived._replace(rewards=rewards), trace)
    assert found == pytest.approx([lived.q[t][driver] for t, driver in enumerate(lived.drivers)], abs=1e-9)


# Eq. 20: the assignment


def moved(table: Sequence[Sequence[float]], active: list[list[int]], drivers: list[int], weights: list[list[float]],
          targets: list[float], rate: float, shared_rate: float) -> np.ndarray:  # fmt: skip
    """What `move_towards` makes of a table."""
    changed = np.array(table, dtype=np.float64)
    eq.move_towards(
        changed, np.array(active), np.array(drivers), np.array(weights), np.array(targets), rate, shared_rate
    )
    return changed


def test_theta_of_the_driver_gains_what_the_others_lose_and_u_takes_its_own_share() -> None:
    # Q(s, B_0) is 0 and G is 8: theta_0 += 0.1 / 2 * (1 - 0.25) * 8, theta_1 -= 0.1 / 2 * 0.75 * 8, U += 0.2 / 2 * 8.
    found = moved([[0.0] * 3] * 3, [[0, 2]], [0], [[0.25, 0.75]], [8.0], 0.1, 0.2)
    assert found == pytest.approx(np.array([[0.3, -0.3, 0.8], [0.0, 0.0, 0.0], [0.3, -0.3, 0.8]]), abs=1e-15)


def test_only_a_td_error_moves_anything() -> None:
    # theta(s) = (3, 1) and U(s) = 4: Q(s, B_0) = 4 + 3 - (0.5 * 3 + 0.5 * 1) = 5.
    table = [[2.0, 1.0, 1.0], [1.0, 0.0, 3.0]]
    assert moved(table, [[0, 1]], [0], [[0.5, 0.5]], [5.0], 0.1, 0.2) == pytest.approx(np.array(table), abs=1e-15)
    # A TD error of 1: (1 - 0.5) * 0.1 / 2 and 0.2 / 2 of it.
    expected = np.add(table, [0.025, -0.025, 0.1])
    assert moved(table, [[0, 1]], [0], [[0.5, 0.5]], [6.0], 0.1, 0.2) == pytest.approx(expected, abs=1e-15)


def test_with_an_alpha_of_0_only_u_learns() -> None:
    assert moved([[0.0] * 3], [[0]], [0], [[0.5, 0.5]], [8.0], 0.0, 0.5).tolist() == [[0.0, 0.0, 4.0]]


class Minibatch(NamedTuple):
    """Decisions with their targets, and the table before."""

    table: list[list[float]]
    active: list[list[int]]
    drivers: list[int]
    weights: list[list[float]]
    targets: list[float]


@st.composite
def minibatches(draw: st.DrawFn, most: int = 8) -> Minibatch:
    n, features, decisions = draw(st.integers(1, 4)), draw(st.integers(1, 4)), draw(st.integers(1, most))
    row = st.lists(st.integers(0, 7), min_size=features, max_size=features, unique=True)
    active = draw(st.lists(row, min_size=decisions, max_size=decisions))
    rng = np.random.default_rng(draw(st.integers(0, 10**6)))
    return Minibatch(
        rng.normal(size=(8, n + 1)).tolist(),
        active,
        rng.integers(0, n, decisions).tolist(),
        rng.dirichlet(np.ones(n), decisions).tolist(),
        (5.0 * rng.normal(size=decisions)).tolist(),
    )


def q_of_the_driver(table: Sequence[Sequence[float]], active: list[int], driver: int, weights: list[float]) -> float:
    """Eq. 17, in plain Python."""
    *theta, shared = [sum(table[f][i] for f in active) for i in range(len(weights) + 1)]
    return shared + theta[driver] - sum(w * x for w, x in zip(weights, theta, strict=True))


@given(minibatches(), st.floats(0, 3), st.floats(0.01, 3))
def test_the_assignment_is_the_literal_loop(batch: Minibatch, rate: float, shared_rate: float) -> None:
    """Divided where the decisions share so many features that together they would overshoot."""
    expected = [list(row) for row in batch.table]
    together = rate + shared_rate
    for row, driver, weights, target in zip(*batch[1:], strict=True):
        td_error = target - q_of_the_driver(batch.table, row, driver, weights)
        shared = sum(together / len(row) for f in row for other in batch.active for g in other if f == g)
        for f in row:
            for i, weight in enumerate(weights):
                expected[f][i] += rate / len(row) * ((i == driver) - weight) * td_error / max(1.0, shared)
            expected[f][-1] += shared_rate / len(row) * td_error / max(1.0, shared)
    assert moved(*batch, rate, shared_rate) == pytest.approx(np.array(expected), abs=1e-9)


@given(minibatches(most=1), st.floats(0.01, 0.4), st.floats(0.01, 0.4))
def test_the_step_is_down_the_gradient_of_the_squared_error(batch: Minibatch, rate: float, shared_rate: float) -> None:
    """For one decision; by central differences."""
    ((row, driver, weights, target),) = zip(*batch[1:], strict=True)

    def error(table: list[list[float]]) -> float:
        return (target - q_of_the_driver(table, row, driver, weights)) ** 2 / 2

    steps = moved(*batch, rate, shared_rate) - np.array(batch.table)
    for f in range(8):
        for i in range(len(weights) + 1):
            slope = difference(error, batch.table, f, i)
            share = (rate if i < len(weights) else shared_rate) / len(row)
            assert steps[f, i] == pytest.approx(-share * slope, abs=1e-6)


def difference(value: Callable[[list[list[float]]], float], table: list[list[float]], f: int, i: int) -> float:
    """How `value` changes with one number of a table."""
    step = 1e-5
    found: list[float] = []
    for change in (step, -step):
        other = [list(row) for row in table]
        other[f][i] += change
        found.append(value(other))
    return (found[0] - found[1]) / (2 * step)


@pytest.mark.parametrize("decisions", [1, 10, 128, 5000])
def test_a_robot_that_stands_still_does_not_overshoot(decisions: int) -> None:
    """In a deadlock every decision has the same features."""
    table = moved([[0.0] * 3] * 4, [[0, 1, 2, 3]] * decisions, [0] * decisions, [[0.5, 0.5]] * decisions,
                  [10.0] * decisions, 0.002, 0.05)  # fmt: skip
    found = q_of_the_driver(table.tolist(), [0, 1, 2, 3], 0, [0.5, 0.5])
    assert 0.0 < found <= 10.0 + 1e-9
