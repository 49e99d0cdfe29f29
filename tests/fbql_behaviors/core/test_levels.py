"""Levels and classes of any command space; the wheels' are a special case, bit for bit."""

from __future__ import annotations

import numpy as np
import pytest
from fbql_behaviors.core.levels import (
    class_at,
    class_count,
    command_at,
    in_levels,
    level_at,
    levels_at,
    lowest_of,
    origin_of,
    value_at,
)
from fbql_behaviors.core.quantizer import LEVEL_RAD_S, level_of, levels_of_classes, rad_s_of, wheel_class_of
from fbql_common.core.command_space import Axis, CommandSpace
from fbql_common.core.field import WHEELS
from hypothesis import given
from hypothesis import strategies as st

FORWARD = Axis("linear.x", "m/s", -0.2, 0.8, 11)
TURN = Axis("angular.z", "rad/s", -1.5, 1.5, 13)
AWAY = Axis("linear.x", "m/s", 0.15, 0.75, 4)
SPACE = CommandSpace((FORWARD, TURN))
AXES = (FORWARD, TURN, AWAY, *WHEELS.axes)


def values_of(axis: Axis) -> list[float]:
    """The levels' values, literally: evenly spaced from low to high."""
    return np.linspace(axis.low, axis.high, axis.levels).tolist()


@pytest.mark.parametrize("axis", AXES)
def test_the_levels_are_evenly_spaced_from_low_to_high(axis: Axis) -> None:
    levels = range(lowest_of(axis), lowest_of(axis) + axis.levels)
    assert [value_at(axis, level) for level in levels] == pytest.approx(values_of(axis))
    assert [level_at(axis, value_at(axis, level)) for level in levels] == list(levels)


def test_level_0_is_standstill_where_that_is_a_level_and_else_the_low_end() -> None:
    assert [origin_of(axis) for axis in AXES] == [0.0, 0.0, 0.15, 0.0, 0.0]
    assert (level_at(FORWARD, 0.0), lowest_of(FORWARD), lowest_of(AWAY)) == (0, -2, 0)


@given(st.sampled_from(AXES), st.floats(-100.0, 100.0))
def test_the_nearest_level_is_taken_and_beyond_an_end_the_end(axis: Axis, value: float) -> None:
    nearest = min(abs(value - each) for each in values_of(axis))
    assert abs(value - value_at(axis, level_at(axis, value))) == pytest.approx(nearest, abs=1e-9)


def test_of_two_levels_as_near_the_one_farther_from_0_is_taken() -> None:
    axis = Axis("linear.x", "m/s", -2.0, 2.0, 5)
    assert [level_at(axis, value) for value in (0.5, -0.5, 1.5, -1.5, 1e300, -1e300)] == [1, -1, 2, -2, 2, -2]


def test_the_classes_number_every_combination_once_the_first_axis_coarsest() -> None:
    commands = [(v, w) for v in values_of(FORWARD) for w in values_of(TURN)]
    classes = [class_at(SPACE, command) for command in commands]
    assert classes == list(range(class_count(SPACE))) == list(range(143))
    for levels, command in zip(levels_at(SPACE, np.array(classes)).tolist(), commands, strict=True):
        assert command_at(SPACE, levels) == pytest.approx(command)
    assert in_levels(SPACE, np.array(commands)) == pytest.approx(levels_at(SPACE, np.array(classes)))


def test_a_command_of_a_mean_of_levels_never_leaves_the_limits() -> None:
    axis = Axis("linear.x", "m/s", -0.1, 0.3, 5)
    assert value_at(axis, 3) > 0.3, "by a rounding error"
    assert command_at(CommandSpace((axis,)), [3.0]) == (0.3,)


@given(st.floats(-100.0, 100.0), st.floats(-100.0, 100.0), st.floats(-14.0, 14.0))
def test_the_wheels_have_the_paper_s_levels_bit_for_bit(left: float, right: float, level: float) -> None:
    wheel = WHEELS.axes[0]
    assert level_at(wheel, left) == level_of(left)
    assert class_at(WHEELS, (left, right)) == wheel_class_of(left, right)
    assert value_at(wheel, level) == rad_s_of(level) == level * 88.0 / 14
    number = wheel_class_of(left, right)
    assert levels_at(WHEELS, np.array([number])).tolist() == levels_of_classes(np.array([number])).tolist()
    assert in_levels(WHEELS, np.array([[left, right]])).tolist() == [[left / LEVEL_RAD_S, right / LEVEL_RAD_S]]
