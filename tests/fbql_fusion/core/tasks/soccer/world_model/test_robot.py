"""Eqs. 21 and 23: how the robot follows a command."""

from __future__ import annotations

import numpy as np
import pytest
from fbql_common.core.field import AXLE_M
from fbql_fusion.core.tasks.soccer.world_model.forest import fit_forest
from fbql_fusion.core.tasks.soccer.world_model.robot import (
    NEAR_INPUTS,
    RobotMotion,
    Wheels,
    fit_wheels,
    free_robot,
    interpolated,
    robot_near_wall,
    slope,
    wheel_speeds,
)
from hypothesis import given
from hypothesis import strategies as st

LIMIT = 0.1
"""The change of a wheel's speed in a step that the real robot does not exceed [m/s]."""


def test_between_two_points_the_function_is_linear_and_beyond_the_last_it_is_constant() -> None:
    at, values = np.array([-1.0, 1.0, 2.0]), np.array([0.0, 10.0, 30.0])
    assert [interpolated(x, at, values) for x in (-5.0, -1.0, 0.0, 1.0, 1.5, 2.0, 9.0)] == [0, 0, 5, 10, 20, 30, 30]


@given(st.floats(-3, 3), st.lists(st.floats(-2, 2), min_size=1, max_size=9, unique=True))
def test_it_is_numpys_interpolation(x: float, points: list[float]) -> None:
    at = np.array(sorted(points))
    values = np.sin(3.0 * at)
    assert interpolated(x, at, values) == pytest.approx(float(np.interp(x, at, values)))


def test_wheel_speeds_differ_by_what_turns() -> None:
    assert wheel_speeds(1.0, 2.0) == pytest.approx((1.0 - AXLE_M, 1.0 + AXLE_M))


def test_the_free_robot_moves_by_what_its_wheels_gain() -> None:
    wheels = Wheels(np.array([-0.1, 0.1]), np.array([-0.1, 0.1]), 0.5, 0.25, 2.0)
    motion = free_robot(wheels, 0.2, 0.2, 0.9, 0.25)
    left, right = 0.2 + 0.1, 0.2 + 0.05
    speed, rate = (left + right) / 2, (right - left) / AXLE_M
    assert motion == pytest.approx((0.5 * speed, 0.25 * speed * rate, 2.0 * rate, speed, rate, 0.0))


def test_fitted_wheels_have_the_limits_of_those_that_were_seen() -> None:
    rng = np.random.default_rng(1)
    errors = rng.uniform(-1.0, 1.0, (2000, 2))
    changes = np.clip(errors, -LIMIT, LIMIT)
    after = rng.uniform(-1.0, 1.0, (2000, 2))
    speed, rate = after.T
    wheels = fit_wheels(errors, changes, np.column_stack([0.02 * speed, 0.01 * speed * rate, 0.03 * rate]), after, 80)
    assert len(wheels.errors) == 80
    assert interpolated(0.7, wheels.errors, wheels.changes) == pytest.approx(LIMIT)
    assert interpolated(-0.05, wheels.errors, wheels.changes) == pytest.approx(-0.05, abs=2e-3)
    assert wheels[2:] == pytest.approx((0.02, 0.01, 0.03))


def test_equal_errors_make_one_bin() -> None:
    zeros = np.zeros((50, 2))
    wheels = fit_wheels(zeros, zeros + 0.01, np.zeros((50, 3)), zeros, 80)
    assert wheels.errors.tolist() == [0.0]
    assert interpolated(0.4, wheels.errors, wheels.changes) == pytest.approx(0.01)


def test_near_a_wall_a_tree_adds_to_the_free_motion_and_tells_the_contact() -> None:
    x = np.linspace(0.0, 1.0, 8)[:, None] * np.ones(NEAR_INPUTS)
    y = np.tile(np.arange(6.0), (8, 1))
    forest = fit_forest(x, y, 1, 4, np.random.default_rng(0))
    free = RobotMotion(0.1, 0.2, 0.3, 0.4, 0.5, 0.0)
    assert robot_near_wall(forest, 0, x[0], free) == pytest.approx((0.1, 1.2, 2.3, 3.4, 4.5, 5.0))


def test_a_slope_of_nothing_is_nothing() -> None:
    assert slope(np.zeros(3), np.ones(3)) == 0.0
    assert slope(np.array([1.0, 2.0]), np.array([2.0, 4.0])) == 2.0
