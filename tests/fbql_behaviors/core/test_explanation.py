"""Trees in words: each feature once, units, sides, motions."""

from __future__ import annotations

import re
from math import inf, nextafter, pi, radians

import pytest
from fbql_behaviors.core.explanation import (
    Motion,
    Rule,
    command_text,
    condition,
    conditions,
    describe_tree,
    is_direction,
    motion_of,
    rounded,
    rules,
    speed_of,
    twist_motion_of,
)
from fbql_behaviors.core.observation import Feature
from fbql_behaviors.core.quantizer import LEVEL_RAD_S
from fbql_behaviors.core.tree import CommandLeaf, Leaf, Split, Tree
from fbql_common.core.command_space import Axis, Command, CommandSpace
from fbql_common.core.field import MAX_WHEEL_RAD_S, WHEELS
from hypothesis import given
from hypothesis import strategies as st
from tree_strategies import FEATURES, trees

DISTANCE, BEARING = FEATURES
ERROR = Feature("detour_heading_error", "rad", -pi, pi)
PSI = Feature("approach_angle", "rad", -pi, pi)


def angle(feature: Feature, low: float, high: float) -> str:
    """The words for an interval of degrees."""
    return " ".join(condition(feature, radians(low), radians(high)))


def test_a_rule_names_each_feature_once_however_often_the_way_halved_it() -> None:
    nodes = (Split(0, 1.6, 1, 2), Split(0, 0.8, 3, 4), 0, 1, Split(1, 0.0, 5, 6), 2, Split(0, 1.2, 7, 8), 3, 4)
    tree = Tree("ball_seeking", FEATURES, nodes, tuple(Leaf(20.0, 45.0, 12) for _ in range(5)))
    assert [rule.where for rule in rules(tree)] == [
        "ball 1.6 m away or farther",
        "ball nearer than 0.8 m",
        "ball 0.8-1.6 m away, to the right",
        "ball 0.8-1.2 m away, to the left",
        "ball 1.2-1.6 m away, to the left",
    ]
    assert rules(tree)[3].sentence == (
        "ball 0.8-1.2 m away, to the left -> forwards, turning left (left 20, right 45 rad/s; 12 patterns)"
    )
    assert describe_tree(tree).splitlines()[0].startswith("leaf 0: ball 1.6 m away or farther -> ")


def test_a_tree_of_one_leaf_always_does_the_same() -> None:
    rule = rules(Tree("ball_seeking", FEATURES, (0,), (Leaf(80.0, 80.0, 1),)))[0]
    assert rule.conditions == ()
    assert rule.sentence == "always -> fast forwards (left 80, right 80 rad/s; 1 pattern)"


@given(trees())
def test_a_sentence_names_exactly_the_features_that_its_region_restricts(tree: Tree) -> None:
    for rule, region in zip(rules(tree), tree.regions(), strict=True):
        restricted = sum((f.low, f.high) != interval for f, interval in zip(FEATURES, region, strict=True))
        assert len(rule.conditions) == restricted
        assert rule.sentence.count("ball") == (restricted > 0)
        assert rule.sentence == rules(tree)[rule.leaf_id].sentence


@pytest.mark.parametrize(
    ("low", "high", "words"),
    [
        (10, 20, "ball 10-20 degrees to the left"),
        (-20, -10, "ball 10-20 degrees to the right"),
        (0, 180, "ball to the left"),
        (-180, 0, "ball to the right"),
        (-20, 0.5, "ball between 20 degrees to the right and 0.5 to the left"),
        (135, 180, "ball 135-180 degrees to the left, behind"),
        (-180, -90, "ball 90-180 degrees to the right, behind"),
        (-5, 5, "ball within 5 degrees of straight ahead"),
        (-45, 22.5, "ball between 45 degrees to the right and 22.5 to the left"),
        (-180, 45, "ball anywhere to the right or up to 45 degrees to the left"),
        (-90, 180, "ball anywhere to the left or up to 90 degrees to the right"),
        (0, 11.25, "ball 0-11.3 degrees to the left"),
        (33.75, 45, "ball 33.8-45 degrees to the left"),
    ],
)
def test_bearings_are_told_in_degrees_and_sides(low: float, high: float, words: str) -> None:
    assert angle(BEARING, low, high) == words


def test_a_heading_error_and_the_approach_angle_are_told_as_sides_too() -> None:
    assert angle(ERROR, 10, 20) == "detour 10-20 degrees to the left"
    assert angle(PSI, -20, -10) == "ball-to-goal line 10-20 degrees to the right"


@pytest.mark.parametrize(
    ("low", "high", "words"),
    [(0.0, 0.6, "nearer than 0.6 m"), (0.3, 0.6, "0.3-0.6 m away"), (1.6, 3.2, "1.6 m away or farther")],
)
def test_distances_are_told_in_metres(low: float, high: float, words: str) -> None:
    assert condition(DISTANCE, low, high) == ("ball", words)


@pytest.mark.parametrize(
    ("feature", "low", "high", "words"),
    [
        (Feature("speed", "m/s", 0.0, 2.0), 0.5, 1.0, "speed 0.5 to 1 m/s"),
        (Feature("speed", "m/s", 0.0, 2.0), 0.0, 1.0, "speed below 1 m/s"),
        (Feature("speed", "m/s", 0.0, 2.0), 1.0, 2.0, "speed 1 or more m/s"),
        (Feature("tilt", "rad", -1.0, 1.0), -1.0, 0.0, "tilt below 0 degrees"),
        (Feature("gap_bearing", "rad", 0.0, 1.0), 0.5, 1.0, "gap bearing 28.6 or more degrees"),
        (Feature("side", "", -1.0, 1.0), -0.5, 0.5, "side -0.5 to 0.5"),
        (Feature("x_distance", "cm", 0.0, 9.0), 1.0, 2.0, "x distance 1 to 2 cm"),
    ],
)
def test_any_other_feature_is_told_by_its_name_in_its_unit(
    feature: Feature, low: float, high: float, words: str
) -> None:
    assert " ".join(condition(feature, low, high)).strip() == words


def test_a_whole_region_has_no_conditions() -> None:
    assert conditions(FEATURES, tuple((feature.low, feature.high) for feature in FEATURES)) == ()


@pytest.mark.parametrize(
    ("left", "right", "motion"),
    [
        (0.0, 0.0, Motion.STAND),
        (3.0, -3.0, Motion.STAND),
        (50.0, 50.0, Motion.FORWARDS),
        (50.0, 54.0, Motion.FORWARDS),
        (19.0, 21.0, Motion.FORWARDS),
        (-21.0, -19.0, Motion.BACKWARDS),
        (18.9, 21.0, Motion.FORWARDS_LEFT),
        (2.7, 3.5, Motion.FORWARDS_LEFT),
        (-3.5, -2.7, Motion.BACKWARDS_LEFT),
        (LEVEL_RAD_S / 2, LEVEL_RAD_S / 2, Motion.FORWARDS),
        (0.0, nextafter(LEVEL_RAD_S / 2, 0.0), Motion.STAND),
        (20.0, 45.0, Motion.FORWARDS_LEFT),
        (45.0, 20.0, Motion.FORWARDS_RIGHT),
        (0.0, 45.0, Motion.FORWARDS_LEFT),
        (-20.0, 20.0, Motion.SPIN_LEFT),
        (30.0, -10.0, Motion.SPIN_RIGHT),
        (-30.0, 10.0, Motion.SPIN_LEFT),
        (-50.0, -50.0, Motion.BACKWARDS),
        (-45.0, -20.0, Motion.BACKWARDS_LEFT),
        (-20.0, -45.0, Motion.BACKWARDS_RIGHT),
    ],
)
def test_wheels_make_motions(left: float, right: float, motion: Motion) -> None:
    assert motion_of(left, right) is motion


@given(st.floats(-88.0, 88.0), st.floats(-88.0, 88.0))
def test_a_motion_mirrors_with_its_wheels(left: float, right: float) -> None:
    mirrored = motion_of(right, left).name
    swapped = {"LEFT": "RIGHT", "RIGHT": "LEFT"}
    assert mirrored == re.sub("LEFT|RIGHT", lambda found: swapped[found[0]], motion_of(left, right).name)


def test_speed_is_that_of_the_faster_wheel() -> None:
    assert [speed_of(0.0, wheel) for wheel in (0.0, 10.0, 29.0, 30.0, -58.0, -59.0, 88.0)] == [
        "", "slow", "slow", "", "", "fast", "fast",
    ]  # fmt: skip


def test_slow_and_fast_begin_and_end_at_thirds_of_full_speed_and_slow_at_half_a_level() -> None:
    third, two_thirds, least = MAX_WHEEL_RAD_S / 3, MAX_WHEEL_RAD_S * 2 / 3, LEVEL_RAD_S / 2
    assert [speed_of(wheel, 0.0) for wheel in (third, two_thirds, least)] == ["", "fast", "slow"]
    below = [speed_of(nextafter(wheel, 0.0), 0.0) for wheel in (third, two_thirds, least)]
    assert below == ["slow", "", ""]


TWIST = CommandSpace(
    (
        Axis("linear.x", "m/s", -0.5, 1.0, 16),  # levels of 0.1 m/s
        Axis("linear.y", "m/s", -0.5, 0.5, 5),  # of 0.25 m/s
        Axis("angular.z", "rad/s", -3.0, 3.0, 13),  # of 0.5 rad/s
    )
)


def rule_of(command: Command) -> Rule:
    """The rule of a tree that always gives this command."""
    return rules(Tree("any", FEATURES, (0,), (CommandLeaf(command, 1),), commands=TWIST))[0]


@pytest.mark.parametrize(
    ("command", "motion"),
    [
        ((0.0, 0.0, 0.0), Motion.STAND),
        ((0.5, 0.0, 0.0), Motion.FORWARDS),
        ((0.5, 0.0, 1.0), Motion.FORWARDS_LEFT),
        ((0.5, 0.0, -1.0), Motion.FORWARDS_RIGHT),
        ((-0.5, 0.0, 0.0), Motion.BACKWARDS),
        ((-0.5, 0.0, 1.0), Motion.BACKWARDS_LEFT),
        ((-0.5, 0.0, -1.0), Motion.BACKWARDS_RIGHT),
        ((0.0, 0.0, 1.0), Motion.SPIN_LEFT),
        ((0.0, 0.0, -1.0), Motion.SPIN_RIGHT),
        ((0.0, 0.4, 0.0), Motion.SIDEWAYS_LEFT),
        ((0.0, -0.4, 1.0), Motion.SIDEWAYS_RIGHT),
        ((0.5, 0.4, 0.0), Motion.FORWARDS),
        ((0.0, 0.0, 0.25), Motion.SPIN_LEFT),  # from half a level on it counts
        ((0.0, 0.0, -0.25), Motion.SPIN_RIGHT),
        ((0.0, 0.0, nextafter(0.25, 0.0)), Motion.STAND),
        ((0.0, nextafter(-0.125, 0.0), 0.0), Motion.STAND),
        ((0.0, 0.125, 0.0), Motion.SIDEWAYS_LEFT),
    ],
)
def test_velocities_make_motions(command: Command, motion: Motion) -> None:
    assert twist_motion_of(TWIST, command) is motion
    assert rule_of(command).motion is motion


def test_an_axis_that_is_not_known_makes_no_motion() -> None:
    assert twist_motion_of(CommandSpace((Axis("gripper", "", 0.0, 1.0, 2),)), (1.0,)) is Motion.STAND
    assert twist_motion_of(CommandSpace((Axis("angular.z", "rad/s", -1.0, 1.0, 3),)), (1.0,)) is Motion.SPIN_LEFT


@pytest.mark.parametrize(
    ("command", "speed"),
    [
        ((0.0, 0.0, 0.0), ""),
        ((0.3, 0.0, 0.0), "slow"),
        ((1 / 3, 0.0, 0.0), ""),  # slow is below a third
        ((nextafter(1 / 3, 0.0), 0.0, 0.0), "slow"),
        ((2 / 3, 0.0, 0.0), "fast"),  # fast is from two thirds on
        ((nextafter(2 / 3, 0.0), 0.0, 0.0), ""),
        ((-0.5, 0.0, 0.0), ""),  # full speed is that of the faster direction
        ((0.3, 0.0, 3.0), "slow"),  # turning counts only where nothing is driven
        ((0.0, 0.0, 3.0), "fast"),
        ((0.0, 0.0, -0.5), "slow"),
        ((0.0, 0.0, 0.24), ""),  # less than half a level is none
        ((0.04, 0.0, 3.0), "fast"),
        ((0.0, 0.0, 0.25), "slow"),
        ((0.3, 0.4, 0.0), "fast"),  # the faster axis counts
    ],
)
def test_slow_and_fast_begin_and_end_at_thirds_of_full_velocity(command: Command, speed: str) -> None:
    assert rule_of(command).speed == speed


def test_a_command_is_told_with_its_axes_and_units_and_a_digit_more_than_its_levels_need() -> None:
    assert command_text(WHEELS, (20.4, 45.0)) == "left 20, right 45 rad/s"
    assert command_text(TWIST, (0.4, 0.0, -0.75)) == "linear.x 0.4 m/s, linear.y 0 m/s, angular.z -0.75 rad/s"
    assert command_text(CommandSpace((Axis("gripper", "", 0.0, 9.0, 10),)), (4.52,)) == "gripper 4.5"


def test_a_command_of_another_number_of_axes_is_never_told_in_part() -> None:
    for told in (command_text, twist_motion_of):
        for command in ((0.4, 0.0), (0.4, 0.0, 0.0, 0.0)):
            with pytest.raises(ValueError, match="zip"):
                told(TWIST, command)


def test_only_symmetric_angles_are_directions() -> None:
    assert is_direction(BEARING) and is_direction(ERROR) and is_direction(PSI)
    assert not is_direction(DISTANCE)
    assert not is_direction(BEARING._replace(low=-3.0)) and not is_direction(BEARING._replace(unit="m"))


def test_a_number_has_just_enough_digits_to_tell_the_ends_apart() -> None:
    assert rounded((0.0, 0.5), 0.5) == ["0", "0.5"]
    assert rounded((10.04, 20.04), 10.0) == ["10", "20"]
    assert rounded((0.123456, 0.133456), 0.01) == ["0.123", "0.133"]


@given(st.floats(-100.0, 100.0), st.floats(1e-6, 100.0))
def test_rounding_tells_the_ends_of_an_interval_apart(low: float, width: float) -> None:
    high = low + width
    if high > nextafter(low, inf):
        first, last = rounded((low, high), high - low)
        assert float(first) < float(last)
        assert abs(float(first) - low) <= 0.051 * max(width, 1.0)
        assert "-0" not in (first, last)
