"""Equations 5 and 6: numbers computed by hand, a slow literal oracle, and the invariance that stops them learning."""

from itertools import pairwise

import numpy as np
import pytest
from fbql_common.core.types import DRIVER_BLEND
from fbql_fusion.core.controllers.interface import Transition
from fbql_fusion.core.learners.literal.equations import (
    bounded_weights,
    count_ties,
    fused_value,
    maxima,
    normalised,
    printed_weights,
    updated_q,
)
from fbql_fusion.core.learners.literal.learner import FbqlLiteral
from fbql_fusion.core.learners.literal.parameters import TIE_RULES
from fbql_fusion.core.parameters import FusionParameters
from hypothesis import given
from hypothesis import strategies as st

numbers = st.floats(-100, 100)
shares = st.floats(0, 1)


@st.composite
def states(draw, count=2):
    """q and weights of `count` joint states with the same 1..5 behaviors; the weights of each sum to 1."""
    n = draw(st.integers(1, 5))
    rows = []
    for _ in range(count):
        q = draw(st.lists(numbers, min_size=n, max_size=n))
        raw = draw(st.lists(st.floats(0.01, 1), min_size=n, max_size=n))
        rows.append((q, [w / sum(raw) for w in raw]))
    return rows


# Eq. 5


def test_next_state_is_worth_the_weighted_sum_of_its_q():
    assert fused_value([0.25, 0.75], [2.0, 4.0]) == 3.5


def test_q_moves_by_alpha_towards_its_share_of_the_reward_plus_what_follows():
    # Targets: 0.25 * 4 + 0.9 * 3 = 3.7 and 0.75 * 4 + 0.9 * 3 = 5.7; half of the way there.
    assert updated_q([1.0, 2.0], [0.25, 0.75], 4.0, 3.0, 0.5, 0.9) == pytest.approx((2.35, 3.85), abs=1e-15)


def test_q_settles_where_it_equals_its_target():
    q = [0.0, 0.0]
    for _ in range(2000):
        q = updated_q(q, [0.25, 0.75], 4.0, 0.0, 0.1, 0.9)
    assert q == pytest.approx((1.0, 3.0))


@given(states(), numbers, shares, shares)
def test_eq_5_is_the_printed_formula(rows, reward, learning_rate, discount):
    (q, w), (next_q, next_w) = rows
    expected = []
    for i in range(len(q)):
        bracket = w[i] * reward
        for j in range(len(next_q)):
            bracket += discount * next_w[j] * next_q[j]
        bracket -= q[i]
        expected.append(q[i] + learning_rate * bracket)
    actual = updated_q(q, w, reward, fused_value(next_w, next_q), learning_rate, discount)
    assert actual == pytest.approx(expected, abs=1e-9)


# Eq. 6


def test_the_argmax_gains_and_the_others_lose_in_proportion():
    # Gains 0.1 (2.35 + 1) = 0.335 and 0.1 (3.85 + 1) = 0.485.
    updated = printed_weights([0.25, 0.75], [2.35, 3.85], (1,), 0.1, 1.0)
    assert updated == pytest.approx((0.25 - 0.25 * 0.335, 0.75 + 0.25 * 0.485), abs=1e-15)
    assert normalised(updated, 0.0) == pytest.approx((0.16625 / 1.0375, 0.87125 / 1.0375), abs=1e-15)


def test_printed_update_turns_around_below_minus_f():
    """The argmax loses where Q + f < 0: why the gain is bounded."""
    updated = printed_weights([0.5, 0.5], [-3.0, -4.0], (0,), 0.1, 1.0)
    assert updated[0] < 0.5 < updated[1]
    bounded = bounded_weights([0.5, 0.5], [-3.0, -4.0], (0,), 0.1, 1.0, 0.0, 1.0)
    assert bounded == (0.5, 0.5)


def test_printed_update_overshoots_where_the_gain_is_above_one():
    updated = printed_weights([0.5, 0.5], [30.0, 20.0], (0,), 0.1, 0.0)
    assert updated == pytest.approx((2.0, -0.5))
    assert bounded_weights([0.5, 0.5], [30.0, 20.0], (0,), 0.1, 0.0, 0.0, 1.0) == (1.0, 0.0)


@given(states(count=1), st.floats(0, 1), numbers, st.data())
def test_eq_6_is_the_printed_formula(rows, weight_gain, weight_offset, data):
    ((q, w),) = rows
    best = data.draw(st.integers(0, len(q) - 1))
    expected = []
    for i in range(len(q)):
        if i == best:
            expected.append(w[i] + (1 - w[i]) * weight_gain * (q[i] + weight_offset))
        else:
            expected.append(w[i] + -w[i] * weight_gain * (q[i] + weight_offset))
    assert printed_weights(w, q, (best,), weight_gain, weight_offset) == pytest.approx(expected, abs=1e-9)


@given(states(count=1), st.floats(0, 10), numbers, st.floats(0, 0.2), st.sets(st.integers(0, 4)))
def test_with_bounds_weights_sum_to_one_and_are_never_negative(rows, weight_gain, weight_offset, floor, best):
    ((q, w),) = rows
    weights = normalised(bounded_weights(w, q, best, weight_gain, weight_offset, 0.0, 1.0), floor)
    if weights is None:
        # Nobody is the argmax, everybody's gain is 1, and there is no floor.
        assert floor == 0.0
        return
    assert sum(weights) == pytest.approx(1.0, abs=1e-12)
    assert min(weights) >= 0.0


@given(states(count=1), st.floats(0.001, 0.2), st.data())
def test_no_weight_falls_far_below_the_floor(rows, floor, data):
    ((q, w),) = rows
    best = data.draw(st.integers(0, len(q) - 1))
    weights = normalised(bounded_weights(w, q, (best,), 1.0, 0.0, 0.0, 1.0), floor)
    assert weights is not None
    assert min(weights) >= floor / (2.0 + len(q) * floor)


@pytest.mark.parametrize("weights", [(0.0, 0.0), (1.0, -1.0), (float("nan"), 1.0), (float("inf"), 1.0)])
def test_weights_without_a_sum_to_divide_by_are_not_normalised(weights):
    assert normalised(weights, -1e9) is None


def test_maxima_are_all_behaviors_with_the_largest_q():
    assert maxima([1.0, 3.0, 3.0, 2.0]) == (1, 2)
    assert maxima([1.0]) == (0,)
    assert maxima([float("nan"), 1.0]) == ()


# The invariance


@pytest.mark.parametrize("tie_rule", TIE_RULES)
@given(
    path=st.lists(st.integers(0, 4), min_size=2, max_size=60),
    initial_q=numbers,
    seed=st.integers(0, 1000),
)
def test_without_reward_equal_q_stay_equal_whatever_the_tie_rule(tie_rule, path, initial_q, seed):
    """Eq. 5 with r = 0 has the same target for every behavior of a state: sparse reward teaches nothing."""
    parameters = FusionParameters(tie_rule=tie_rule, initial_q=initial_q)
    literal = FbqlLiteral(parameters, np.random.default_rng(seed))
    for state, next_state in pairwise(path):
        literal.learn(Transition((state,) * 3, (1.0, 0.0, 0.0), 0, 0.0, (next_state,) * 3, False, False))
    q = literal.to_arrays()["q"]
    assert len(q) == len(set(path[:-1]))
    assert (q == q[:, :1]).all()


@given(reward=numbers, state=st.integers(0, 3), rows=states(count=1))
def test_one_reward_parts_the_q_of_its_own_state_by_the_weights_and_of_no_other(reward, state, rows):
    weights = rows[0][1]
    n = len(weights)
    parameters = FusionParameters(behaviors=[f"b{i}" for i in range(n)], learning_rate=0.5, tie_rule="none")
    literal = FbqlLiteral(parameters, np.random.default_rng(0))
    literal.load_arrays(
        {
            "joint_states": np.repeat(np.arange(4, dtype=np.int32)[:, None], n, axis=1),
            "q": np.zeros((4, n)),
            "weights": np.tile(weights, (4, 1)),
        }
    )
    literal.learn(Transition((state,) * n, tuple(weights), DRIVER_BLEND, reward, (3 - state,) * n, False, False))
    q = literal.to_arrays()["q"]
    for leaf in range(4):
        expected = [0.5 * w * reward for w in weights] if leaf == state else [0.0] * n
        assert q[leaf] == pytest.approx(expected, abs=1e-12)


def test_a_joint_state_is_tied_where_all_q_are_equal_to_the_last_bit() -> None:
    q = np.array([[0.0, 0.0, 0.0], [1.0, 1.0, np.nextafter(1.0, 2.0)], [2.5, 2.5, 2.5], [1.0, 1.0, 0.0]])
    assert count_ties(q) == 2
    assert count_ties(q[:0]) == 0


@pytest.mark.parametrize("n", [1, 2, 8])
def test_one_behavior_is_always_tied_and_the_number_of_behaviors_stands_nowhere(n: int) -> None:
    assert count_ties([[0.5] * n]) == 1
    assert count_ties([[0.5] * (n - 1) + [0.25]]) == (n == 1)
