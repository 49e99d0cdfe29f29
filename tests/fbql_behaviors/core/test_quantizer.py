"""The 29 levels and the 841 classes."""

from __future__ import annotations

import math

import numpy as np
import pytest
from fbql_behaviors.core.quantizer import (
    CLASS_COUNT,
    LEVEL_COUNT,
    LEVEL_RAD_S,
    MAX_LEVEL,
    class_of_levels,
    level_of,
    levels_of,
    levels_of_classes,
    rad_s_of,
    wheel_class_of,
)
from fbql_common.core.errors import BadInput
from fbql_common.core.field import MAX_WHEEL_RAD_S
from hypothesis import given
from hypothesis import strategies as st

WHEELS = st.floats(-MAX_WHEEL_RAD_S, MAX_WHEEL_RAD_S)


def nearest_level_slowly(wheel_rad_s: float) -> int:
    """The literal oracle: of all levels the nearest, of two equally near ones that farther from 0."""
    return min(range(-MAX_LEVEL, MAX_LEVEL + 1), key=lambda k: (abs(wheel_rad_s - k * MAX_WHEEL_RAD_S / 14), -abs(k)))


def test_there_are_29_levels_and_841_classes() -> None:
    assert (LEVEL_COUNT, CLASS_COUNT) == (29, 841)


def test_level_0_is_standstill_and_level_14_is_full() -> None:
    assert (level_of(0.0), level_of(MAX_WHEEL_RAD_S), level_of(-MAX_WHEEL_RAD_S)) == (0, 14, -14)
    assert (rad_s_of(0), rad_s_of(14), rad_s_of(-14)) == (0.0, MAX_WHEEL_RAD_S, -MAX_WHEEL_RAD_S)


def test_a_tie_between_two_levels_goes_away_from_zero() -> None:
    assert (level_of(0.5 * LEVEL_RAD_S), level_of(-0.5 * LEVEL_RAD_S)) == (1, -1)


def test_a_velocity_beyond_full_counts_as_full() -> None:
    assert (level_of(1e9), level_of(-1e9)) == (14, -14)


@pytest.mark.parametrize("wheel_rad_s", [math.nan, math.inf, -math.inf])
def test_a_velocity_that_is_not_finite_is_refused(wheel_rad_s: float) -> None:
    with pytest.raises(BadInput, match="not finite"):
        level_of(wheel_rad_s)


@given(WHEELS)
def test_the_nearest_level_is_that_of_the_literal_search(wheel_rad_s: float) -> None:
    distance = abs(wheel_rad_s - rad_s_of(level_of(wheel_rad_s)))
    assert distance == pytest.approx(abs(wheel_rad_s - rad_s_of(nearest_level_slowly(wheel_rad_s))), abs=1e-12)


@given(WHEELS)
def test_backwards_is_the_mirror_of_forwards(wheel_rad_s: float) -> None:
    assert level_of(-wheel_rad_s) == -level_of(wheel_rad_s)


def test_every_class_has_its_own_levels_and_comes_back_from_them() -> None:
    pairs = [levels_of(wheel_class) for wheel_class in range(CLASS_COUNT)]
    assert len(set(pairs)) == CLASS_COUNT
    assert [class_of_levels(*pair) for pair in pairs] == list(range(CLASS_COUNT))
    assert levels_of_classes(np.arange(CLASS_COUNT)).tolist() == [list(pair) for pair in pairs]


def test_the_left_wheel_is_the_coarse_digit_of_a_class() -> None:
    assert class_of_levels(-14, -14) == 0
    assert class_of_levels(-14, -13) == 1
    assert class_of_levels(-13, -14) == 29
    assert wheel_class_of(0.0, 0.0) == 14 * 29 + 14


@given(st.integers(-MAX_LEVEL, MAX_LEVEL), st.integers(-MAX_LEVEL, MAX_LEVEL))
def test_quantizing_a_quantized_pair_changes_nothing(left: int, right: int) -> None:
    assert wheel_class_of(rad_s_of(left), rad_s_of(right)) == class_of_levels(left, right)
