"""The weighted sum of references, and what becomes of it when weights or behaviors fail."""

import math

import pytest
from fbql_common.core.field import MAX_WHEEL_RAD_S, WHEELS
from fbql_common.core.types import BehaviorOutput
from fbql_fusion.core.blending import blend, live_weights
from fbql_fusion.core.tasks.twist.answers import SourceLeaves
from hypothesis import given
from hypothesis import strategies as st

references = st.floats(-MAX_WHEEL_RAD_S, MAX_WHEEL_RAD_S)


def answer(left: float, right: float) -> BehaviorOutput:
    return BehaviorOutput(1, 0, 0, "b", left, right, 0, 1, "", False, ())


def test_command_is_the_weighted_sum_of_the_references():
    fused = blend((0.5, 0.25, 0.25), [answer(10.0, -4.0), answer(20.0, 8.0), answer(-8.0, 16.0)], WHEELS)
    assert fused == ((8.0, 4.0), (0.5, 0.25, 0.25), False)


@given(st.lists(st.tuples(st.floats(0.01, 1), references, references), min_size=1, max_size=8))
def test_a_blend_lies_between_its_references(parts):
    total = sum(part[0] for part in parts)
    fused = blend([part[0] / total for part in parts], [answer(left, right) for _, left, right in parts], WHEELS)
    assert min(p[1] for p in parts) - 1e-9 <= fused.command[0] <= max(p[1] for p in parts) + 1e-9
    assert min(p[2] for p in parts) - 1e-9 <= fused.command[1] <= max(p[2] for p in parts) + 1e-9
    assert not fused.rejected


@pytest.mark.parametrize(
    "weights",
    [(), (1.0,), (0.25,) * 4, (math.nan, 0.5, 0.5), (math.inf, 0.0, 0.0), (math.inf, -math.inf, 1.0), (1e308,) * 3],
)
def test_weights_of_wrong_length_or_not_finite_give_way_to_uniform_ones(weights):
    fused = blend(weights, [answer(3.0, 0.0), answer(6.0, 0.0), answer(9.0, 3.0)], WHEELS)
    assert fused.rejected
    assert fused.weights == (1 / 3,) * 3
    assert fused.command == pytest.approx((6.0, 1.0))


@pytest.mark.parametrize(("more", "used"), [(0.9e-9, True), (-0.9e-9, True), (1.1e-9, False), (-1.1e-9, False)])
def test_weights_that_sum_to_1_within_a_billionth_are_used_as_they_are_and_others_in_proportion(more, used):
    weights = (0.5, 0.5 + more)
    fused = blend(weights, [answer(10.0, 0.0), answer(0.0, 10.0)], WHEELS)
    assert (fused.weights == weights) == used
    assert sum(fused.weights) == (sum(weights) if used else pytest.approx(1.0, abs=1e-15))
    assert not fused.rejected


def test_one_that_answers_but_may_not_drive_counts_as_missing():
    leaves = SourceLeaves(WHEELS)
    fused = blend((0.75, 0.25), [leaves.answer((8.0, 8.0), active=False), leaves.answer((4.0, 2.0))], WHEELS)
    assert fused == ((4.0, 2.0), (0.0, 1.0), False)


def test_weights_of_missing_behaviors_are_shared_in_proportion():
    fused = blend((0.5, 0.3, 0.2), [None, answer(10.0, 0.0), answer(0.0, 10.0)], WHEELS)
    assert fused.weights == pytest.approx((0.0, 0.6, 0.4))
    assert fused.command == pytest.approx((6.0, 4.0))
    assert not fused.rejected


def test_the_live_weigh_the_same_where_all_weight_was_on_the_missing():
    assert live_weights((1.0, 0.0, 0.0), [False, True, True]) == ((0.0, 0.5, 0.5), False)


def test_with_everybody_missing_the_wheels_stop():
    assert blend((0.5, 0.5), [None, None], WHEELS) == ((0.0, 0.0), (0.0, 0.0), False)


@given(st.lists(st.tuples(st.floats(0, 1), st.booleans()), min_size=1, max_size=6))
def test_live_weights_sum_to_one_over_the_live_and_are_zero_elsewhere(parts):
    live = [part[1] for part in parts]
    weights, rejected = live_weights([part[0] for part in parts], live)
    assert not rejected
    assert all(weight == 0.0 for weight, is_live in zip(weights, live, strict=True) if not is_live)
    assert sum(weights) == pytest.approx(1.0 if any(live) else 0.0)


def test_weights_that_leave_the_unit_range_never_command_more_than_the_wheels_can():
    """Possible only with the bounds of eq. 6 switched off."""
    fused = blend((11.0, -10.0), [answer(80.0, -80.0), answer(-80.0, 80.0)], WHEELS)
    assert fused.command == (MAX_WHEEL_RAD_S, -MAX_WHEEL_RAD_S)
