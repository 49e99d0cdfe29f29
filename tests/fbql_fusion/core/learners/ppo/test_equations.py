"""Equations 10 to 15: numbers computed by hand, and slow literal oracles in plain Python."""

from __future__ import annotations

from math import log

import numpy as np
import pytest
from equation_oracles import gradient, literal_softmax, preference_lists
from fbql_fusion.core.learners.linear import add_shared, log_weight_gradient, row_sum, shares_of
from fbql_fusion.core.learners.ppo import equations as eq
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.typing import NDArray

numbers = st.floats(-20, 20)
shares = st.floats(0, 1)


def random_masks(rng: np.random.Generator, decisions: int, n: int) -> NDArray[np.bool_]:
    """Which behaviors may drive, one at least, [N, n]."""
    masks = rng.random((decisions, n)) < 0.6
    masks[np.arange(decisions), rng.integers(0, n, decisions)] = True
    return masks


# Eq. 10


def test_weights_are_in_proportion_to_the_powers_of_the_preferences() -> None:
    assert eq.softmax([0.0, log(3.0)]) == pytest.approx((0.25, 0.75), abs=1e-15)
    assert eq.softmax([7.0]) == (1.0,)


@given(preference_lists(), st.floats(-600, 600))
def test_weights_sum_to_1_and_stay_when_all_preferences_shift(h: list[float], shift: float) -> None:
    weights = eq.softmax(h)
    assert weights == pytest.approx(literal_softmax(h), abs=1e-14)
    assert sum(weights) == pytest.approx(1.0, abs=1e-14)
    assert eq.softmax([x + shift for x in h]) == pytest.approx(weights, abs=1e-12)


@given(preference_lists(), st.data())
def test_a_behavior_that_may_not_drive_weighs_nothing_and_the_others_as_if_it_were_not_there(
    h: list[float], data: st.DataObject
) -> None:
    mask = data.draw(st.lists(st.booleans(), min_size=len(h), max_size=len(h)).filter(any))
    others = iter(literal_softmax([x for x, may_drive in zip(h, mask, strict=True) if may_drive]))
    expected = [next(others) if may_drive else 0.0 for may_drive in mask]
    found = eq.softmax(h, mask)
    assert found == pytest.approx(expected, abs=1e-14)
    assert {w for w, may_drive in zip(found, mask, strict=True) if not may_drive} <= {0.0}


def test_preferences_far_apart_do_not_overflow() -> None:
    assert eq.softmax([-1e4, 1e4]) == (0.0, 1.0)


@given(st.integers(1, 4), st.integers(0, 5), st.integers(1, 6), st.integers(0, 1000))
def test_the_weights_of_many_decisions_are_those_of_each(n: int, features: int, decisions: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    theta = rng.normal(size=(8, n))
    active = rng.integers(0, 8, size=(decisions, features))
    masks = random_masks(rng, decisions, n)
    found = eq.weights_of(theta, active, masks)
    assert found.shape == (decisions, n)
    for row, mask, weights in zip(active.tolist(), masks.tolist(), found.tolist(), strict=True):
        assert weights == pytest.approx(eq.softmax(row_sum(theta, row), mask), abs=1e-14)


def test_preferences_of_any_size_have_weights() -> None:
    theta = np.array([[1e4, -1e4], [-1e4, -1e4]])
    both = np.ones((2, 2), dtype=np.bool_)
    assert eq.weights_of(theta, np.array([[0], [1]]), both).tolist() == [[1.0, 0.0], [0.5, 0.5]]


# Eqs. 12 and 13


def test_advantage_is_the_td_error_and_a_decayed_share_of_later_ones() -> None:
    # d_0 = 0 + 0.5 * 2 - 1 = 0 and d_1 = 10 + 0.5 * 4 - 2 = 10; A_1 = 10 and A_0 = 0 + 0.5 * 0.5 * 10.
    found = eq.advantages(np.array([0.0, 10.0]), np.array([0.5, 0.5]), np.array([1.0, 2.0, 4.0]), 0.5)
    assert found.tolist() == [2.5, 10.0]


@st.composite
def episodes(draw: st.DrawFn) -> tuple[list[float], list[float], list[float]]:
    """R, gamma^k and V of an episode of 1 to 8 decisions."""
    length = draw(st.integers(1, 8))
    rewards = draw(st.lists(numbers, min_size=length, max_size=length))
    discounts = draw(st.lists(shares, min_size=length, max_size=length))
    return rewards, discounts, draw(st.lists(numbers, min_size=length + 1, max_size=length + 1))


@given(episodes(), shares)
def test_advantages_are_the_double_sum_of_their_definition(
    episode: tuple[list[float], list[float], list[float]], trace: float
) -> None:
    rewards, discounts, values = episode
    expected: list[float] = []
    for t in range(len(rewards)):
        total = 0.0
        for later in range(t, len(rewards)):
            share = 1.0
            for between in range(t, later):
                share *= discounts[between] * trace
            total += share * (rewards[later] + discounts[later] * values[later + 1] - values[later])
        expected.append(total)
    found = eq.advantages(np.array(rewards), np.array(discounts), np.array(values), trace)
    assert found.tolist() == pytest.approx(expected, abs=1e-9)


@given(episodes())
def test_with_lambda_1_advantage_and_value_are_the_discounted_return(
    episode: tuple[list[float], list[float], list[float]],
) -> None:
    rewards, discounts, values = episode
    later = values[-1]
    returns: list[float] = []
    for reward, discount in zip(reversed(rewards), reversed(discounts), strict=True):
        later = reward + discount * later
        returns.insert(0, later)
    found = eq.advantages(np.array(rewards), np.array(discounts), np.array(values), 1.0) + values[:-1]
    assert found.tolist() == pytest.approx(returns, abs=1e-9)


def test_normalised_advantages_have_mean_0_and_deviation_1() -> None:
    assert eq.normalised_advantages(np.array([1.0, 3.0])).tolist() == pytest.approx([-1.0, 1.0], abs=1e-7)


@given(st.lists(numbers, min_size=1, max_size=9), st.floats(0.1, 9), numbers)
def test_normalised_advantages_do_not_depend_on_the_unit_of_reward(
    values: list[float], scale: float, shift: float
) -> None:
    assume(np.std(values) > 0.01)
    once = eq.normalised_advantages(np.array(values))
    assert eq.normalised_advantages(scale * np.array(values) + shift) == pytest.approx(once, abs=1e-4)


def test_where_nothing_is_better_than_anything_else_no_advantage_is_left() -> None:
    assert eq.normalised_advantages(np.full(3, 7.0)).tolist() == [0.0, 0.0, 0.0]


# Eq. 14


def test_a_drawn_behavior_with_an_advantage_gains_what_the_others_lose() -> None:
    found = eq.clipped_surrogate_step(np.array([[0.5, 0.5]]), np.array([0]), np.array([0.5]), np.array([2.0]), 0.4)
    assert found.tolist() == [[1.0, -1.0]]


@pytest.mark.parametrize(
    ("advantage", "weight", "expected"),
    [
        (1.0, 0.8, 0.0),  # rho = 1.6 > 1.4: far enough up
        (-1.0, 0.8, -1.6 * 0.2),  # the wrong way: back
        (-1.0, 0.2, 0.0),  # rho = 0.4 < 0.6: far enough down
        (1.0, 0.2, 0.4 * 0.8),
        (1.0, 0.65, 1.3 * 0.35),
        (-1.0, 0.35, -0.7 * 0.65),
    ],
)
def test_a_weight_that_went_far_enough_is_left_alone(advantage: float, weight: float, expected: float) -> None:
    weights = np.array([[weight, 1.0 - weight]])
    found = eq.clipped_surrogate_step(weights, np.array([0]), np.array([0.5]), np.array([advantage]), 0.4)
    assert found[0].tolist() == pytest.approx([expected, -expected])


@given(preference_lists(2), preference_lists(2), st.floats(-3, 3), st.floats(0.05, 0.9), st.data())
def test_clipped_surrogate_step_is_the_gradient_of_the_clipped_surrogate(
    h: list[float], before: list[float], advantage: float, clip: float, data: st.DataObject
) -> None:
    n = min(len(h), len(before))
    h, before = h[:n], before[:n]
    drawn = data.draw(st.integers(0, n - 1))
    old_prob = literal_softmax(before)[drawn]
    rho = literal_softmax(h)[drawn] / old_prob
    assume(min(abs(rho - 1 - clip), abs(rho - 1 + clip)) > 1e-3)  # there the surrogate has a corner

    def objective(x: list[float]) -> float:
        weights = literal_softmax(x)
        ratio = weights[drawn] / old_prob
        clipped = min(max(ratio, 1 - clip), 1 + clip)
        return min(ratio * advantage, clipped * advantage)

    found = eq.clipped_surrogate_step(
        np.array([literal_softmax(h)]), np.array([drawn]), np.array([old_prob]), np.array([advantage]), clip
    )
    expected = gradient(objective, h)
    assert found[0].tolist() == pytest.approx(expected, abs=1e-5 * max(1.0, rho))


# The approximate KL divergence


def test_approx_kl_is_the_mean_of_rho_less_1_less_its_log() -> None:
    weights = np.array([[0.5, 0.5], [0.2, 0.8]])
    found = eq.approx_kl(weights, np.array([0, 1]), np.array([0.25, 0.8]))
    assert found == pytest.approx((2.0 - 1.0 - log(2.0)) / 2.0)


@given(st.lists(st.tuples(st.floats(0.001, 1), st.floats(0.001, 1)), min_size=1, max_size=9))
def test_approx_kl_is_never_below_0_and_0_where_nothing_changed(pairs: list[tuple[float, float]]) -> None:
    now, then = np.array(pairs).T
    weights = np.stack([now, 1.0 - now], axis=1)
    drawn = np.zeros(len(pairs), dtype=np.int64)
    assert eq.approx_kl(weights, drawn, then) >= -1e-9
    assert eq.approx_kl(weights, drawn, now) == pytest.approx(0.0, abs=1e-9)


def test_a_pass_takes_every_decision_once_a_minibatch_at_a_time() -> None:
    """Also where the last minibatch is smaller."""
    rng = np.random.default_rng(5)
    decisions, n = 7, 3
    active, inputs = rng.integers(0, 6, (decisions, 2)), rng.integers(0, 9, (decisions, 4))
    masks = random_masks(rng, decisions, n)
    drivers = np.array([rng.choice(np.flatnonzero(mask)) for mask in masks])
    batch = eq.Batch(active, inputs, drivers, masks, *(rng.random(decisions) + 0.2 for _ in range(3)))
    rates = eq.Rates(0.1, 0.2, 0.4)
    for weights_change in (True, False):
        theta, value = rng.normal(size=(6, n)), rng.normal(size=9)
        expected_theta, expected_value = theta.copy(), value.copy()
        for some in (slice(0, 3), slice(3, 6), slice(6, 7)):
            if weights_change:
                weights = eq.weights_of(expected_theta, active[some], masks[some])
                step = eq.clipped_surrogate_step(
                    weights, drivers[some], batch.old_probs[some], batch.advantages[some], rates.clip
                )
                add_shared(expected_theta, active[some], step, rates.policy)
            eq.update_critic(expected_value, inputs[some], batch.lambda_returns[some], rates.critic)
        eq.policy_pass(theta, value, batch, 3, weights_change, rates)
        assert theta.tobytes() == expected_theta.tobytes()
        assert value.tobytes() == expected_value.tobytes()


def test_large_preferences_give_weights_and_no_overflow() -> None:
    theta = np.array([[1000.0, 1001.0], [-1000.0, -1000.0]])
    assert eq.weights_of(theta, np.array([[0], [1]]), np.ones((2, 2), dtype=np.bool_)) == pytest.approx(
        np.array([[1 / (1 + np.e), np.e / (1 + np.e)], [0.5, 0.5]])
    )


# Kernels: what is compiled is the loop, and has NumPy's bits


@given(st.integers(1, 9), st.integers(1, 40), st.integers(0, 1000))
def test_each_loop_has_the_bits_of_its_numpy_form(n: int, decisions: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    theta, active = rng.normal(size=(8, n)), rng.integers(0, 8, size=(decisions, 5))
    masks = random_masks(rng, decisions, n)
    weights = eq.weights_of.function(theta, active, masks)
    assert weights.tobytes() == eq.weights_of.interpreted(theta, active, masks).tobytes()
    drawn, old_prob, advantage = rng.integers(0, n, decisions), rng.random(decisions) + 0.1, rng.normal(size=decisions)
    given = weights, drawn, old_prob, advantage, 0.4
    assert (eq.clipped_surrogate_step.function(*given) == eq.clipped_surrogate_step.interpreted(*given)).all()
    given = advantage, old_prob, rng.normal(size=decisions + 1), 0.9
    assert eq.advantages.function(*given).tobytes() == eq.advantages.interpreted(*given).tobytes()
    assert log_weight_gradient.function(weights, drawn).tobytes() == (
        log_weight_gradient.interpreted(weights, drawn).tobytes()
    )
    steps, moved = rng.normal(size=(decisions, n)), rng.integers(1, 99, decisions)
    assert shares_of.function(steps, moved, 0.01).tobytes() == shares_of.interpreted(steps, moved, 0.01).tobytes()
