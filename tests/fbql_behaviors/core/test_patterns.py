"""Patterns and demonstrations: what is accepted, and what is refused with the row."""

from __future__ import annotations

import math

import numpy as np
import pytest
from fbql_behaviors.core.observation import OBSERVATIONS, Feature
from fbql_behaviors.core.patterns import MAX_PATTERNS, Demonstration, Patterns, patterns_from_rows, patterns_of
from fbql_behaviors.core.quantizer import wheel_class_of
from fbql_common.core.errors import BadInput
from fbql_common.core.types import WheelCommand, World

FEATURES = (Feature("distance", "m", 0.0, 1.0), Feature("bearing", "rad", -1.0, 1.0))
BALL = OBSERVATIONS["ball_seeking"]


def demonstration(steps: int, episode: int = 0) -> Demonstration:
    worlds = tuple(
        World(1, episode, k, -0.01 * k, 0.0, 0.0, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0, 0.0, 0.9, 0.0, *[False] * 6)
        for k in range(steps)
    )
    commands = tuple(WheelCommand(1, episode, k, 6.0 * k, 0.0) for k in range(steps))
    return Demonstration(worlds, commands)


def test_a_pattern_is_what_was_sensed_and_the_class_of_the_command() -> None:
    patterns = patterns_of([demonstration(3)], BALL)
    assert patterns.x.tolist() == [[0.5, 0.0], [0.51, 0.0], [0.52, 0.0]]
    assert patterns.wheel_class.tolist() == [wheel_class_of(6.0 * k, 0.0) for k in range(3)]
    assert patterns.features == BALL.features


def test_every_so_many_steps_a_pattern_is_taken_and_the_demonstrations_are_numbered() -> None:
    patterns = patterns_of([demonstration(7), demonstration(4, 1)], BALL, every=3)
    assert patterns.x[:, 0].tolist() == pytest.approx([0.5, 0.53, 0.56, 0.5, 0.53])
    assert patterns.demonstration.tolist() == [0, 0, 0, 1, 1]


def test_more_patterns_than_asked_for_are_thinned_out_evenly() -> None:
    patterns = patterns_of([demonstration(10)], BALL, count=5)
    assert patterns.x[:, 0].tolist() == pytest.approx([0.5, 0.52, 0.54, 0.56, 0.58])


def test_no_demonstrations_make_no_patterns_but_an_error() -> None:
    """Fault 55."""
    with pytest.raises(BadInput, match="no patterns"):
        patterns_of([], BALL)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_a_value_that_is_not_finite_is_refused_with_its_row_and_feature(value: float) -> None:
    """Fault 59."""
    with pytest.raises(BadInput, match="pattern row 2: feature 'bearing' is"):
        patterns_from_rows(FEATURES, [(0.0, 0.0), (0.1, 0.1), (0.2, value)], [0, 1, 2])


def test_a_text_is_refused_with_its_row_and_feature() -> None:
    """Fault 59."""
    with pytest.raises(BadInput, match="pattern row 1: feature 'distance' is 'near', which is not a number"):
        patterns_from_rows(FEATURES, [(0.0, 0.0), ("near", 0.1)], [0, 1])


def test_a_row_of_a_wrong_length_is_refused() -> None:
    with pytest.raises(BadInput, match="pattern row 1: 1 attributes; expected 2"):
        patterns_from_rows(FEATURES, [(0.0, 0.0), (0.1,)], [0, 1])


@pytest.mark.parametrize("wheel_class", [-1, 841])
def test_a_class_that_does_not_exist_is_refused_with_its_row(wheel_class: int) -> None:
    with pytest.raises(BadInput, match=f"pattern row 1: wheel class {wheel_class}"):
        patterns_from_rows(FEATURES, [(0.0, 0.0), (0.1, 0.1)], [0, wheel_class])


def test_patterns_cannot_be_changed() -> None:
    patterns = patterns_from_rows(FEATURES, [(0.0, 0.0)], [0])
    with pytest.raises(ValueError, match="read-only"):
        patterns.x[0, 0] = 1.0


def test_ten_million_patterns_are_refused_with_the_memory_they_would_take() -> None:
    """Fault 60."""
    n = 10_000_000
    with pytest.raises(BadInput, match=r"^10000000 patterns, whose induction would take about 2\.3 GiB of memory"):
        Patterns(FEATURES, np.zeros((n, 2)), np.zeros(n, np.int64), np.zeros(n, np.int64))


def test_as_many_patterns_as_are_supported_are_taken_and_not_one_more() -> None:
    for n, taken in ((MAX_PATTERNS, True), (MAX_PATTERNS + 1, False)):
        x, zeros = np.zeros((n, 2)), np.zeros(n, np.int64)
        if taken:
            assert len(Patterns(FEATURES, x, zeros, zeros)) == n
        else:
            with pytest.raises(BadInput, match="at most 5000000 are supported"):
                Patterns(FEATURES, x, zeros, zeros)


def test_the_sha256_depends_on_attributes_classes_and_units() -> None:
    rows = [(0.25, 0.5), (0.5, -0.5)]
    patterns = patterns_from_rows(FEATURES, rows, [3, 4])
    assert patterns.sha256 == patterns_from_rows(FEATURES, rows, [3, 4]).sha256
    others = [
        patterns_from_rows(FEATURES, [(0.25, 0.5), (0.5, 0.5)], [3, 4]),
        patterns_from_rows(FEATURES, rows, [3, 5]),
        patterns_from_rows((FEATURES[0]._replace(unit="cm"), FEATURES[1]), rows, [3, 4]),
    ]
    assert len({patterns.sha256, *(other.sha256 for other in others)}) == 4


def test_odd_patterns_are_warned_about() -> None:
    """Fault 56, and half of fault 57."""
    assert patterns_from_rows(FEATURES, [(0.1, 0.2)], [0]).warnings() == [
        "there is one pattern only: the tree will be a single leaf"
    ]
    assert (
        "all patterns are of one class" in patterns_from_rows(FEATURES, [(0.1, 0.2), (0.3, 0.4)], [5, 5]).warnings()[0]
    )
    assert patterns_from_rows(FEATURES, [(0.1, 0.2), (0.1, 0.4)], [5, 6]).warnings() == [
        "feature 'distance' never changes: the tree cannot use it"
    ]
    assert patterns_from_rows(FEATURES, [(0.1, 0.2), (0.3, 0.4)], [5, 6]).warnings() == []


@pytest.mark.parametrize(("commonest", "warned"), [(100_000, True), (1000, True), (999, False)])
def test_a_great_imbalance_of_classes_is_warned_about(commonest: int, warned: bool) -> None:
    """Fault 61."""
    n = commonest + 1
    x = np.stack((np.arange(n) / n, np.arange(n) / n), axis=1)
    classes = np.zeros(n, np.int64)
    classes[0] = 1
    said = Patterns(FEATURES, x, classes, np.zeros(n, np.int64)).warnings()
    rare = f"the commonest class has {commonest} patterns, the rarest 1: the rare ones will hardly count"
    assert said == ([rare] if warned else [])


@pytest.mark.parametrize(("alone", "warned"), [(3, True), (2, False)])
def test_classes_that_no_other_demonstration_shows_are_warned_about(alone: int, warned: bool) -> None:
    """Fault 61: held out, such a class was never seen."""
    n = 20
    rows = [(0.04 * k, 0.02 * k) for k in range(n)]
    classes = [5] * (n - alone) + [6] * alone
    numbers = [k % 2 for k in range(n - alone)] + [2] * alone
    said = patterns_from_rows(FEATURES, rows, classes, numbers).warnings()
    assert ("3 of 20 patterns are of classes that occur in only one demonstration" in "".join(said)) == warned
    assert patterns_from_rows(FEATURES, rows, classes).warnings() == []  # of a single demonstration nothing is held out


def test_a_demonstration_has_a_command_for_every_world_state() -> None:
    whole = demonstration(3)
    with pytest.raises(BadInput, match="3 world states but 2 commands"):
        Demonstration(whole.worlds, whole.commands[:2])


def test_a_selection_of_patterns_keeps_each_with_its_class_and_its_demonstration() -> None:
    patterns = patterns_from_rows(FEATURES, [[0.5, 0.1], [1.0, -1.0], [2.0, 2.0]], [5, 6, 7], [0, 1, 1])
    chosen = patterns.select(np.array([True, False, True]))
    assert chosen.features == FEATURES
    assert chosen.x.tolist() == [[0.5, 0.1], [2.0, 2.0]]
    assert (chosen.wheel_class.tolist(), chosen.demonstration.tolist()) == ([5, 7], [0, 1])


@pytest.mark.parametrize(
    ("x", "classes", "demonstrations", "says"),
    [
        (np.zeros((2, 3)), 2, 2, r"patterns have shape \(2, 3\); expected \[n, 2\]"),
        (np.zeros((2, 2)), 3, 2, "2 patterns need as many classes and demonstration numbers"),
        (np.zeros((2, 2)), 2, 1, "2 patterns need as many classes and demonstration numbers"),
    ],
)
def test_columns_of_different_lengths_are_refused(
    x: np.ndarray[tuple[int, int], np.dtype[np.float64]], classes: int, demonstrations: int, says: str
) -> None:
    with pytest.raises(BadInput, match=says):
        Patterns(FEATURES, x, np.zeros(classes, np.int64), np.zeros(demonstrations, np.int64))
    with pytest.raises(BadInput, match="1 rows of attributes but 2 wheel classes"):
        patterns_from_rows(FEATURES, [(0.0, 0.0)], [0, 1])


def test_moments_outside_of_the_root_region_make_no_pattern() -> None:
    whole = demonstration(3)
    nowhere = whole.worlds[1]._replace(ball_x_m=100.0)
    patterns = patterns_of([Demonstration((whole.worlds[0], nowhere, whole.worlds[2]), whole.commands)], BALL)
    assert patterns.x[:, 0].tolist() == [0.5, 0.52]
    assert patterns.wheel_class.tolist() == [wheel_class_of(6.0 * k, 0.0) for k in (0, 2)]
