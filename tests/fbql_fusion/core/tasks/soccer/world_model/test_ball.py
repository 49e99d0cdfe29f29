"""Eqs. 24 and 25: how the ball moves."""

from __future__ import annotations

import numpy as np
import pytest
from fbql_fusion.core.tasks.soccer.world_model.ball import WALL_INPUTS, Rolling, ball_near, fit_rolling, free_ball
from fbql_fusion.core.tasks.soccer.world_model.forest import fit_forest


def test_the_free_ball_keeps_a_share_of_its_velocity() -> None:
    assert free_ball(Rolling(0.9, 0.5), 2.0, -1.0) == pytest.approx((-0.2, 0.1, 1.0, -0.5))


def test_the_fitted_share_is_that_of_the_steps_seen() -> None:
    before = np.random.default_rng(1).normal(size=(50, 2))
    assert fit_rolling(before, 0.99 * before, before / 60.0) == pytest.approx((0.99, 1 / 60))


def test_a_ball_that_was_never_seen_to_roll_stays() -> None:
    still = np.zeros((5, 2))
    assert free_ball(fit_rolling(still, still, still), 0.0, 0.0) == (0.0, 0.0, 0.0, 0.0)


def test_near_something_a_tree_says_how_it_bounces() -> None:
    rng = np.random.default_rng(1)
    x = rng.uniform(-1.0, 1.0, (400, WALL_INPUTS))
    bounces = x[:, 1] < 0.0
    y = np.column_stack([np.where(bounces, -1.5 * x[:, 1], 0.0), np.zeros(400), np.zeros(400), 0.1 * x[:, 2]])
    forest = fit_forest(x, y, 3, 3, rng)
    found = [ball_near(forest, tree, np.array([0.0, -0.8, 0.5])) for tree in range(3)]
    assert np.mean([each.change_x_m_s for each in found]) == pytest.approx(1.2, abs=0.15)
    assert {each.change_y_m_s for each in found} == {0.0}
