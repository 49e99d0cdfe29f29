"""Subsumption's layers: who drives when."""

from math import pi

import pytest
from fbql_common.core.types import DRIVER_BLEND, BehaviorOutput, World
from fbql_fusion.core.guides.layers import driver_of
from fbql_fusion.core.parameters import FusionParameters
from fbql_fusion.core.tasks.soccer.subsumption import layers_of

BALL, WALL, APPROACH = 0, 1, 2
ANSWER = BehaviorOutput(1, 0, 0, "b", 1.0, 1.0, 0, 1, "", False, ())
ALL = [ANSWER, ANSWER, ANSWER]
ORDER_OF_THE_TEXT = ["approaching", "wall_avoiding", "ball_seeking"]


def world(wall_m: float, psi_rad: float) -> World:
    """The robot at the origin, a wall point at a distance, the ball so that the approach angle is 0 or pi."""
    ball_x = 0.5 if psi_rad == 0.0 else -0.5
    return World(
        1, 0, 0, 0.0, 0.0, 0.7, 0.0, 0.0, ball_x, 0.0, 0.0, 0.0, 0.0, wall_m, 0.0,
        False, False, False, False, False, False,
    )  # fmt: skip


FREE, NEAR_WALL = world(0.5, 0.0), world(0.05, 0.0)
BESIDE_BALL, BOTH = world(0.5, pi), world(0.05, pi)


@pytest.mark.parametrize(
    ("state", "wall_first", "approaching_first"),
    [(FREE, BALL, BALL), (NEAR_WALL, WALL, WALL), (BESIDE_BALL, APPROACH, APPROACH), (BOTH, WALL, APPROACH)],
)
def test_highest_triggered_layer_drives_in_either_order(state, wall_first, approaching_first):
    assert driver_of(layers_of(FusionParameters()), state, ALL) == wall_first
    assert driver_of(layers_of(FusionParameters(layers=ORDER_OF_THE_TEXT)), state, ALL) == approaching_first


@pytest.mark.parametrize(
    ("missing", "driver"),
    [({WALL}, APPROACH), ({WALL, APPROACH}, BALL), ({BALL}, WALL), ({BALL, WALL, APPROACH}, DRIVER_BLEND)],
)
def test_a_missing_behavior_leaves_the_wheel_to_the_next_lower_layer(missing, driver):
    outputs = [None if i in missing else ANSWER for i in range(3)]
    assert driver_of(layers_of(FusionParameters()), BOTH, outputs) == driver


@pytest.mark.parametrize("state", [FREE, NEAR_WALL, BESIDE_BALL, BOTH])
@pytest.mark.parametrize("alone", [BALL, WALL, APPROACH])
def test_the_only_behavior_left_drives_without_a_trigger(state, alone):
    outputs = [ANSWER if i == alone else None for i in range(3)]
    assert driver_of(layers_of(FusionParameters()), state, outputs) == alone


def test_presets_are_thresholds_and_single_thresholds_replace_the_presets():
    assert FusionParameters(preset="paper").thresholds == (0.07, 2.2)
    assert FusionParameters(preset="tuned").thresholds == (0.07, 0.10)
    assert FusionParameters(preset="paper", wall_threshold_m=0.2).thresholds == (0.2, 2.2)
    assert FusionParameters(preset="paper", approach_threshold_rad=0.0).thresholds == (0.07, 0.0)


@pytest.mark.parametrize(("wall_m", "driver"), [(0.0699, WALL), (0.0701, BALL)])
def test_wall_threshold_is_a_distance_from_the_robots_centre(wall_m, driver):
    layers = layers_of(FusionParameters(preset="paper"))
    assert driver_of(layers, world(wall_m, 0.0), ALL) == driver


@pytest.mark.parametrize(("threshold", "driver"), [(pi - 0.01, APPROACH), (3.2, BALL)])
def test_approach_threshold_is_an_angle(threshold, driver):
    layers = layers_of(FusionParameters(approach_threshold_rad=threshold))
    assert driver_of(layers, BESIDE_BALL, ALL) == driver


@pytest.mark.parametrize("ball_y", [0.5, -0.5])
def test_a_ball_to_the_side_is_approached_from_either_side(ball_y):
    """psi is -0.89 and 0.89 rad."""
    assert driver_of(layers_of(FusionParameters()), FREE._replace(ball_x_m=0.0, ball_y_m=ball_y), ALL) == APPROACH


def test_behaviors_are_found_by_name_in_any_order_and_number():
    fused = FusionParameters(behaviors=["dribbling", "approaching", "ball_seeking"])
    assert driver_of(layers_of(fused), BOTH, ALL) == 1
    assert driver_of(layers_of(fused), FREE, ALL) == 2


def test_a_behavior_without_a_threshold_wants_to_drive_inside_of_its_trees_root_region():
    fused = FusionParameters(behaviors=["dribbling", "ball_seeking"], layers=["dribbling", "ball_seeking"])
    outside = ANSWER._replace(clamped=True)
    assert driver_of(layers_of(fused), FREE, [ANSWER, ANSWER]) == 0
    assert driver_of(layers_of(fused), FREE, [outside, ANSWER]) == 1
    assert driver_of(layers_of(fused), FREE, [None, ANSWER]) == 1
    assert driver_of(layers_of(fused), FREE, [outside, None]) == 0


def test_a_behavior_with_a_threshold_drives_by_it_also_outside_of_its_root_region():
    outside = ANSWER._replace(clamped=True)
    assert driver_of(layers_of(FusionParameters()), BOTH, [outside] * 3) == WALL
