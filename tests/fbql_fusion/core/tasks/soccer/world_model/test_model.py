"""The predicted step: each body's model where it is free or near something, and nothing that overlaps or leaves the numbers."""

from __future__ import annotations

from math import cos, hypot, pi, sin

import numpy as np
import pytest
from fbql_common.core.field import AXLE_M, BALL_RADIUS_M
from fbql_common.core.walls import HALF_WIDTH
from fbql_fusion.core.tasks.soccer.world_model.ball import Rolling
from fbql_fusion.core.tasks.soccer.world_model.forest import Forest
from fbql_fusion.core.tasks.soccer.world_model.model import (
    EMPTY,
    GENERIC_INPUTS,
    GENERIC_OUTPUTS,
    SCRATCH,
    State,
    WorldModel,
    next_state,
    wrapped,
)
from fbql_fusion.core.tasks.soccer.world_model.neighbours import fit_neighbours
from fbql_fusion.core.tasks.soccer.world_model.parameters import FAMILIES
from fbql_fusion.core.tasks.soccer.world_model.robot import Wheels
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

DT = 1 / 60
FREE = EMPTY._replace(
    wheels=Wheels(np.array([-0.1, 0.1]), np.array([-0.1, 0.1]), DT, 0.0, DT), rolling=Rolling(0.99, DT)
)
MIDDLE: State = (0.0, 0.0, 0.0, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0)


def constant(*outputs: float, trees: int = 1) -> Forest:
    """A forest whose trees predict the same whatever the inputs; tree k adds k to the first output."""
    nodes = np.column_stack([np.full(trees, -1.0), np.zeros(trees), np.arange(trees)])
    values = np.tile(np.array(outputs), (trees, 1))
    values[:, 0] += np.arange(trees)
    return Forest(np.arange(trees), nodes, values)


def step(
    model: WorldModel, state: State, left: float = 0.0, right: float = 0.0, seed: int = 0
) -> tuple[NDArray[np.float64], bool]:
    after, touched = next_state(model, state, left, right, np.zeros(SCRATCH), np.random.default_rng(seed))
    return np.array(after), touched


def test_the_free_robot_turns_and_drives_along_its_heading() -> None:
    after, touched = step(FREE, (0.1, 0.2, pi / 2, 0.3, 0.0, 0.5, -0.5, 1.0, 0.0), 0.3, 0.37)
    rate = 0.07 / AXLE_M
    assert after[:5] == pytest.approx([0.1, 0.2 + 0.335 * DT, pi / 2 + rate * DT, 0.335, rate])
    assert after[5:] == pytest.approx([0.5 + DT, -0.5, 0.99, 0.0])
    assert not touched


def test_a_yaw_stays_within_half_a_turn() -> None:
    after, _ = step(FREE, (0.0, 0.0, 3.14, 0.0, 1.0, 0.5, 0.0, 0.0, 0.0), -0.035, 0.035)
    assert after[2] == pytest.approx(3.14 + DT - 2 * pi)


@given(st.floats(-50.0, 50.0))
def test_a_wrapped_angle_is_the_same_direction(angle: float) -> None:
    assert -pi - 1e-9 <= wrapped(angle) <= pi + 1e-9
    assert (cos(wrapped(angle)), sin(wrapped(angle))) == pytest.approx((cos(angle), sin(angle)), abs=1e-9)


@pytest.mark.parametrize("yaw", [0.0, 1.0, -2.5])
def test_near_a_wall_the_robots_forest_corrects_in_its_frame(yaw: float) -> None:
    model = FREE._replace(robot_wall_m=0.5, robot_wall=constant(0.01, 0.02, 0.3, 0.4, 0.5, 1.0), known_sizes=False)
    state = (0.0, HALF_WIDTH - 0.2, yaw, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0)
    after, touched = step(model, state)
    moved = [0.01 * cos(yaw) - 0.02 * sin(yaw), 0.01 * sin(yaw) + 0.02 * cos(yaw)]
    assert after[:2] - np.array(state[:2]) == pytest.approx(moved)
    assert after[2:5] == pytest.approx([yaw + 0.3, 0.4, 0.5])
    assert touched
    away, touched = step(model, MIDDLE)
    assert away[3] == 0.0
    assert not touched


@pytest.mark.parametrize("yaw", [0.0, 1.0, -2.5])
def test_near_the_robot_the_balls_forest_corrects_in_the_robots_frame(yaw: float) -> None:
    model = FREE._replace(ball_robot_m=0.2, ball_robot=constant(1.0, 0.5, 0.02, 0.01), known_sizes=False)
    after, _ = step(model, (0.0, 0.0, yaw, 0.0, 0.0, 0.1, 0.1, 0.3, 0.0))
    free = np.array([0.1 + 0.3 * DT, 0.1, 0.297, 0.0])
    moved = [0.02 * cos(yaw) - 0.01 * sin(yaw), 0.02 * sin(yaw) + 0.01 * cos(yaw)]
    assert after[5:] - free == pytest.approx([*moved, cos(yaw) - 0.5 * sin(yaw), sin(yaw) + 0.5 * cos(yaw)])
    away, _ = step(model, MIDDLE)
    assert away[7] == 0.0


def test_near_a_wall_the_balls_forest_corrects_in_the_walls_frame() -> None:
    model = FREE._replace(ball_wall_m=0.2, ball_wall=constant(1.0, 0.5, 0.02, 0.01), known_sizes=False)
    after, _ = step(model, (0.0, -0.5, 0.0, 0.0, 0.0, 0.1, HALF_WIDTH - 0.1, 0.0, 2.0))
    free = np.array([0.1, HALF_WIDTH - 0.1 + 2.0 * DT, 0.0, 1.98])
    assert after[5:] - free == pytest.approx([0.01, -0.02, 0.5, -1.0])  # the normal is -y, its left +x


def test_the_robot_comes_before_the_wall() -> None:
    model = FREE._replace(
        ball_wall_m=0.2, ball_wall=constant(9.0, 0.0, 0.0, 0.0),
        ball_robot_m=0.2, ball_robot=constant(1.0, 0.0, 0.0, 0.0), known_sizes=False,
    )  # fmt: skip
    after, _ = step(model, (0.0, HALF_WIDTH - 0.1, 0.0, 0.0, 0.0, 0.1, HALF_WIDTH - 0.1, 0.0, 0.0))
    assert after[7:] == pytest.approx([1.0, 0.0])


def test_one_tree_drawn_anew_predicts_each_step() -> None:
    model = FREE._replace(
        trees=3, ball_robot_m=0.2, ball_robot=constant(0.0, 0.0, 0.0, 0.0, trees=3), known_sizes=False
    )
    changes = [step(model, (0.0, 0.0, 0.0, 0.0, 0.0, 0.1, 0.0, 0.0, 0.0), seed=seed)[0][7] for seed in range(40)]
    assert set(changes) == {0.0, 1.0, 2.0}


def test_a_contact_has_the_predicted_probability() -> None:
    model = FREE._replace(robot_wall_m=0.5, robot_wall=constant(0.0, 0.0, 0.0, 0.0, 0.0, 0.25))
    touches = [
        step(model, (0.0, HALF_WIDTH - 0.2, 0.0, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0), seed=seed)[1] for seed in range(400)
    ]
    assert sum(touches) == pytest.approx(100, abs=30)


def test_a_forest_that_was_not_fitted_leaves_the_body_free() -> None:
    model = FREE._replace(robot_wall_m=9.0, ball_robot_m=9.0, ball_wall_m=9.0)
    assert step(model, MIDDLE, 0.05, 0.05)[0] == pytest.approx(step(FREE, MIDDLE, 0.05, 0.05)[0])


def test_known_sizes_keep_the_ball_out_of_the_robot() -> None:
    state = (0.0, 0.0, 0.0, 1.0, 0.0, 0.055, 0.0, 0.0, 0.0)
    inside, _ = step(FREE._replace(known_sizes=False), state, 1.0, 1.0)
    outside, _ = step(FREE._replace(known_sizes=True), state, 1.0, 1.0)
    assert hypot(inside[5] - inside[0], inside[6]) < 0.0375 + BALL_RADIUS_M
    assert hypot(outside[5] - outside[0], outside[6]) == pytest.approx(0.0375 + BALL_RADIUS_M)


def test_a_linear_model_adds_up_its_inputs() -> None:
    weights = np.zeros((GENERIC_INPUTS + 1, GENERIC_OUTPUTS))
    weights[4, 0], weights[12, 1], weights[10, 3], weights[8, 5], weights[3, 2] = DT, 0.5, 0.25, DT, 1.0
    model = EMPTY._replace(family=FAMILIES.index("linear"), linear=weights, known_sizes=False)
    after, _ = step(model, (0.0, 0.0, 0.1, 0.6, 0.0, 0.2, 0.0, 1.2, 0.0), 0.8, 0.0)
    assert after == pytest.approx([0.01, 0.5, 0.1 + sin(0.1), 0.8, 0.0, 0.22, 0.0, 1.2, 0.0])


def test_a_forest_of_the_whole_state_predicts_its_change_and_the_contact() -> None:
    model = EMPTY._replace(
        family=FAMILIES.index("forest"), whole=constant(*np.arange(9.0) / 100, 1.0), known_sizes=False
    )
    after, touched = step(model, MIDDLE)
    assert after - np.array(MIDDLE) == pytest.approx(np.arange(9.0) / 100)
    assert touched


def test_a_neighbour_drawn_anew_predicts_each_step() -> None:
    x = np.zeros((4, GENERIC_INPUTS))
    x[:, 0] = [0.0, 0.1, 5.0, 6.0]  # the robot's x; two are near the middle
    y = np.zeros((4, GENERIC_OUTPUTS))
    y[:, 3], y[:, 9] = [0.1, 0.2, 0.3, 0.4], 1.0
    model = EMPTY._replace(
        family=FAMILIES.index("neighbours"), neighbours=fit_neighbours(x, y), nearest=2, known_sizes=False
    )
    found = [step(model, MIDDLE, seed=seed) for seed in range(40)]
    assert {after[3] for after, _ in found} == {0.1, 0.2}
    assert all(touched for _, touched in found)


def recorded(model: WorldModel, forest: str, state: State) -> NDArray[np.float64]:
    """The inputs that a step gives to a forest."""
    scratch = np.zeros(SCRATCH)
    zero = {"robot_wall": constant(*[0.0] * 6), "ball_robot": constant(*[0.0] * 4), "ball_wall": constant(*[0.0] * 4)}
    model = model._replace(**{forest: zero[forest]})
    next_state(model, state, 0.3, 0.37, scratch, np.random.default_rng(0))
    return scratch


def test_the_robots_forest_is_told_what_free_motion_would_lead_to() -> None:
    model = FREE._replace(robot_wall_m=0.5, known_sizes=False)
    x = recorded(model, "robot_wall", (0.0, HALF_WIDTH - 0.2, pi / 2, 0.3, 0.0, 0.5, 0.0, 0.0, 0.0))
    rate = 0.07 / AXLE_M
    assert x[:4] == pytest.approx([0.3, 0.0, 0.335, rate])
    assert x[4:7] == pytest.approx([0.2 - 0.335 * DT, cos(rate * DT), -sin(rate * DT)])  # ahead, and then to the right


def test_the_balls_forest_is_told_where_it_would_be_beside_the_moved_robot() -> None:
    model = FREE._replace(ball_robot_m=0.5, known_sizes=False)
    x = recorded(model, "ball_robot", (0.0, 0.0, 0.0, 0.3, 0.0, 0.1, 0.02, 1.0, 0.0))
    rate = 0.07 / AXLE_M
    dx, dy, turn = 0.1 + DT - 0.335 * DT, 0.02, rate * DT
    assert x[:2] == pytest.approx([cos(turn) * dx + sin(turn) * dy, cos(turn) * dy - sin(turn) * dx])
    assert x[2:4] == pytest.approx([0.99 * cos(turn) - 0.335, -0.99 * sin(turn)])
    assert x[4:7] == pytest.approx([0.335, rate, HALF_WIDTH - 0.02])
    assert x[7:9] == pytest.approx([-sin(turn), -cos(turn)])


def test_near_a_wall_the_balls_forest_is_told_its_next_distance() -> None:
    model = FREE._replace(ball_wall_m=0.5, known_sizes=False)
    x = recorded(model, "ball_wall", (0.0, 0.0, 0.0, 0.0, 0.0, 0.1, HALF_WIDTH - 0.2, 1.0, 2.0))
    assert x[:3] == pytest.approx([0.2 - 2.0 * DT, -1.98, 0.99])
