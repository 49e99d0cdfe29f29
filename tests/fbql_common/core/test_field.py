"""The field and the robot have the sizes of the FIRA middle league (docs/deviations.md): runs and digests depend on each."""

from __future__ import annotations

from fbql_common.core.field import (
    AXLE_M,
    BALL_RADIUS_M,
    FIELD,
    FREE_BALL_SPOTS_M,
    MAX_WHEEL_RAD_S,
    ROBOT_SIDE_M,
    WHEEL_RADIUS_M,
    WHEELS,
)


def test_the_field_is_220_by_180_cm_with_goals_of_40_cm_and_corners_of_7_cm() -> None:
    assert (FIELD.length_m, FIELD.width_m, FIELD.corner_m) == (2.2, 1.8, 0.07)
    assert (FIELD.goal_width_m, FIELD.goal_depth_m) == (0.4, 0.1)
    assert (FIELD.half_length_m, FIELD.half_width_m, FIELD.half_goal_m) == (1.1, 0.9, 0.2)


def test_the_free_ball_spots_are_in_the_middle_of_the_quarters() -> None:
    assert sorted(FREE_BALL_SPOTS_M) == [(-0.55, -0.6), (-0.55, 0.6), (0.55, -0.6), (0.55, 0.6)]


def test_robot_and_ball_have_their_sizes_and_wheels_their_levels() -> None:
    assert (ROBOT_SIDE_M, AXLE_M, WHEEL_RADIUS_M, BALL_RADIUS_M) == (0.075, 0.07, 0.02, 0.02135)
    assert [tuple(axis) for axis in WHEELS.axes] == [
        ("left", "rad/s", -88.0, 88.0, 29),
        ("right", "rad/s", -88.0, 88.0, 29),
    ]
    assert MAX_WHEEL_RAD_S == 88.0
