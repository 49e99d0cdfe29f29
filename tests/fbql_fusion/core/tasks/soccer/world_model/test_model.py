"""The predicted step: each body's model where it is free or near something, and nothing that overlaps or leaves the numbers."""

from __future__ import annotations

from math import cos, hypot, inf, nextafter, pi, sin, sqrt

import numpy as np
import pytest
from fbql_common.core.field import AXLE_M, BALL_RADIUS_M, ROBOT_SIDE_M
from fbql_common.core.walls import HALF_LENGTH, HALF_WIDTH, closest_wall
from fbql_fusion.core.tasks.soccer.world_model.ball import Rolling
from fbql_fusion.core.tasks.soccer.world_model.bodies import ball_off_robot
from fbql_fusion.core.tasks.soccer.world_model.forest import Forest
from fbql_fusion.core.tasks.soccer.world_model.model import (
    EMPTY,
    GENERIC_INPUTS,
    GENERIC_OUTPUTS,
    SCRATCH,
    State,
    WorldModel,
    apart,
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


def wall_distance(x: float, y: float) -> float:
    wall_x, wall_y, normal_x, normal_y, _ = closest_wall(x, y)
    return (x - wall_x) * normal_x + (y - wall_y) * normal_y


@pytest.mark.parametrize("place", [(0.0, HALF_WIDTH - 0.25), (HALF_LENGTH - 0.1, 0.0), (0.1 - HALF_LENGTH, -0.1)])
def test_at_the_distance_from_which_on_a_body_is_free_of_walls_no_forest_corrects(place: tuple[float, float]) -> None:
    """By a side, and where the end is open."""
    far = wall_distance(*place)
    model = FREE._replace(robot_wall=constant(*[1.0] * 6), ball_wall=constant(*[1.0] * 4), known_sizes=False)
    robot, ball = (*place, *[0.0] * 3, 0.0, 0.0, 0.0, 0.0), (*[0.0] * 5, *place, 0.0, 0.0)
    for least, is_corrected in ((far, False), (nextafter(far, inf), True)):
        assert (step(model._replace(robot_wall_m=least), robot)[0][3] == 1.0) == is_corrected
        assert (step(model._replace(ball_wall_m=least), ball)[0][7] != 0.0) == is_corrected


def test_at_the_distance_from_which_on_the_ball_is_free_of_the_robot_its_forest_does_not_correct() -> None:
    model = FREE._replace(ball_robot_m=0.5, ball_robot=constant(*[1.0] * 4), known_sizes=False)
    assert [step(model, (*MIDDLE[:5], x, 0.0, 0.0, 0.0))[0][7] for x in (0.5, nextafter(0.5, 0.0))] == [0.0, 1.0]


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


@pytest.mark.parametrize(("contact", "draws"), [(0.0, 1), (0.5, 2), (1.0, 1)])
def test_only_an_uncertain_contact_is_drawn(contact: float, draws: int) -> None:
    """The other draw is that of the tree."""
    model = FREE._replace(robot_wall_m=0.5, robot_wall=constant(*[0.0] * 5, contact), known_sizes=False)
    drawn, expected = np.random.default_rng(3), np.random.default_rng(3)
    state = (0.0, HALF_WIDTH - 0.2, *[0.0] * 7)
    _, touched = next_state(model, state, 0.0, 0.0, np.zeros(SCRATCH), drawn)
    assert contact == 0.5 or touched == (contact == 1.0)
    expected.random(draws)
    assert drawn.random() == expected.random()


def test_a_forest_that_was_not_fitted_leaves_the_body_free() -> None:
    model = FREE._replace(robot_wall_m=9.0, ball_robot_m=9.0, ball_wall_m=9.0)
    assert step(model, MIDDLE, 0.05, 0.05)[0] == pytest.approx(step(FREE, MIDDLE, 0.05, 0.05)[0])


def test_known_sizes_keep_the_ball_out_of_the_robot() -> None:
    state = (0.0, 0.0, 0.0, 1.0, 0.0, 0.055, 0.0, 0.0, 0.0)
    inside, _ = step(FREE._replace(known_sizes=False), state, 1.0, 1.0)
    outside, _ = step(FREE._replace(known_sizes=True), state, 1.0, 1.0)
    assert hypot(inside[5] - inside[0], inside[6]) < 0.0375 + BALL_RADIUS_M
    assert hypot(outside[5] - outside[0], outside[6]) == pytest.approx(0.0375 + BALL_RADIUS_M)


@pytest.mark.parametrize("yaw", [0.0, 0.7, -2.0])
def test_known_sizes_move_the_ball_apart_alike_whichever_way_the_robot_heads(yaw: float) -> None:
    for angle in (0.1, 1.2, -2.7):
        ahead, left = 0.05 * cos(angle), 0.05 * sin(angle)
        x, y = cos(yaw) * ahead - sin(yaw) * left, sin(yaw) * ahead + cos(yaw) * left
        moved = apart((0.3, 0.2, yaw, 0.0, 0.0, 0.3 + x, 0.2 + y, 0.0, 0.0))
        ahead, left = ball_off_robot(ahead, left)
        assert hypot(ahead, left) > 0.05
        assert moved[5] == pytest.approx(0.3 + cos(yaw) * ahead - sin(yaw) * left)
        assert moved[6] == pytest.approx(0.2 + sin(yaw) * ahead + cos(yaw) * left)


def test_known_sizes_move_the_robot_off_a_wall_and_the_ball_off_another() -> None:
    yaw = 0.4
    moved = apart((0.2, HALF_WIDTH - 0.01, yaw, 0.1, 0.2, 0.5, 0.01 - HALF_WIDTH, 0.3, 0.4))
    corner_m = ROBOT_SIDE_M / 2 * (cos(yaw) + sin(yaw))
    assert moved == pytest.approx(
        (0.2, HALF_WIDTH - corner_m, yaw, 0.1, 0.2, 0.5, BALL_RADIUS_M - HALF_WIDTH, 0.3, 0.4)
    )


def test_the_model_of_the_whole_state_is_told_state_direction_and_command() -> None:
    scratch = np.zeros(SCRATCH)
    model = EMPTY._replace(family=FAMILIES.index("linear"))
    state = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)
    next_state(model, state, 1.1, 1.2, scratch, np.random.default_rng(0))
    told = [0.1, 0.2, cos(0.3), sin(0.3), 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.1, 1.2]
    assert scratch[:GENERIC_INPUTS].tolist() == told


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


@pytest.mark.parametrize("yaw", [0.5, 2.0, -1.0])
def test_the_robots_forest_is_told_the_distance_and_the_bearing_that_the_wall_would_have(yaw: float) -> None:
    """The wall is on the +y side, so what free motion leads to tells both."""
    model = FREE._replace(wheels=FREE.wheels._replace(drift=0.3), robot_wall_m=0.5, known_sizes=False)
    state = (0.0, HALF_WIDTH - 0.2, yaw, 0.3, 0.4, 0.5, 0.0, 0.0, 0.0)
    free = next_state(model, state, 0.3, 0.37, np.zeros(SCRATCH), np.random.default_rng(0))[0]
    bearing = pi / 2 - free[2]
    assert recorded(model, "robot_wall", state)[4:7] == pytest.approx(
        [HALF_WIDTH - free[1], cos(bearing), sin(bearing)]
    )


@pytest.mark.parametrize(("side_x", "side_y"), [(1.0, 1.0), (-1.0, 1.0)])
def test_by_a_corner_the_balls_forests_are_told_of_both_directions(side_x: float, side_y: float) -> None:
    """The normal of a corner triangle leads along the diagonal."""
    ball = side_x * (HALF_LENGTH - 0.08), side_y * (HALF_WIDTH - 0.08)
    velocity = 0.3 * side_x, 1.0 * side_y
    state = (ball[0] - 0.1, ball[1] - 0.1, 0.5, 0.3, 0.2, *ball, *velocity)
    kept = 0.99 * velocity[0], 0.99 * velocity[1]
    place = ball[0] + velocity[0] * DT, ball[1] + velocity[1] * DT
    normal = -side_x * sqrt(0.5), -side_y * sqrt(0.5)

    wall = recorded(FREE._replace(ball_wall_m=0.5, known_sizes=False), "ball_wall", state)
    off, along = kept[0] * normal[0] + kept[1] * normal[1], normal[0] * kept[1] - normal[1] * kept[0]
    assert wall[:3] == pytest.approx([wall_distance(*place), off, along])

    model = FREE._replace(ball_robot_m=0.5, known_sizes=False)
    robot = next_state(model, state, 0.3, 0.37, np.zeros(SCRATCH), np.random.default_rng(0))[0]

    def in_its_frame(x: float, y: float) -> tuple[float, float]:
        turned = complex(x, y) * complex(cos(robot[2]), -sin(robot[2]))
        return turned.real, turned.imag

    told = recorded(model, "ball_robot", state)
    speed = in_its_frame(*kept)
    assert told[:2] == pytest.approx(in_its_frame(place[0] - robot[0], place[1] - robot[1]))
    assert told[2:4] == pytest.approx((speed[0] - robot[3], speed[1]))
    assert told[4:7] == pytest.approx((robot[3], robot[4], wall_distance(*place)))
    assert told[7:9] == pytest.approx(in_its_frame(*normal))


def test_near_a_wall_the_balls_forest_is_told_its_next_distance() -> None:
    model = FREE._replace(ball_wall_m=0.5, known_sizes=False)
    x = recorded(model, "ball_wall", (0.0, 0.0, 0.0, 0.0, 0.0, 0.1, HALF_WIDTH - 0.2, 1.0, 2.0))
    assert x[:3] == pytest.approx([0.2 - 2.0 * DT, -1.98, 0.99])
