"""Scripted instructors: causal, repeatable, and not perfect."""

from __future__ import annotations

from math import cos, pi

import numpy as np
import pytest
from fbql_behaviors.core.instructors import (
    AGILE,
    INSTRUCTORS,
    Habits,
    Hand,
    Steering,
    approach,
    avoid_wall,
    instructor_of,
    seek_ball,
)
from fbql_behaviors.core.observation import Law
from fbql_behaviors.core.quantizer import LEVEL_RAD_S
from fbql_common.core.errors import BadInput
from fbql_common.core.field import MAX_WHEEL_RAD_S

STEADY = Habits(lag_steps=0, imprecision=0.0, noise_rad_s=0.0, smoothness=0.0)


def test_seeking_turns_towards_the_ball_and_drives_straight_at_one_ahead() -> None:
    left, right = seek_ball((1.0, 0.5))
    assert right > left
    assert seek_ball((1.0, 0.0)) == (65.0, 65.0)
    assert sum(seek_ball((1.0, pi))) == pytest.approx(0.0)


def test_avoiding_backs_out_from_a_wall_ahead_and_drives_off_from_one_behind() -> None:
    assert sum(avoid_wall((0.1, 0.2))) < 0.0
    assert sum(avoid_wall((0.1, 3.0))) > 0.0
    left, right = avoid_wall((0.1, 1.4))
    assert left > right, "away from a wall on the left is to the right"


def test_approaching_is_fastest_in_line_with_the_goal() -> None:
    assert sum(approach((0.0, 0.0))) > sum(approach((0.0, 0.5))) > sum(approach((0.0, 1.0)))


def test_steering_grows_with_the_error_up_to_the_most_there_is() -> None:
    steering = Steering(20.0, 0.5)
    turns = [(right - left) / 2 for left, right in (steering.towards(error, 0.0) for error in (0.0, 0.25, 0.5, 2.0))]
    assert turns == [0.0, 10.0, 20.0, 20.0]


def test_an_agile_instructor_drives_backwards_where_that_is_the_smaller_turn() -> None:
    assert seek_ball((1.0, pi), AGILE) == (-65.0, -65.0)
    left, right = seek_ball((1.0, 3.0), AGILE)
    assert left + right < 0.0
    assert left > right, "the tail turns left, to the ball behind it on the left, when the robot turns right"
    assert sum(seek_ball((1.0, 1.5), AGILE)) > 0.0
    assert sum(approach((2.5, 0.3), AGILE)) < 0.0
    stiff = Steering(20.0, 3.0)
    for error_rad in (-pi / 2, pi / 2):
        assert stiff._replace(reverses=True).towards(error_rad, 10.0) == stiff.towards(error_rad, 10.0), (
            "neither is smaller"
        )


@pytest.mark.parametrize("behavior", sorted(INSTRUCTORS))
def test_a_law_treats_left_and_right_alike(behavior: str) -> None:
    law = INSTRUCTORS[behavior]
    for first in (0.05, 0.15, 0.5):
        for angle in (0.1, 0.9, 1.4, 2.5):
            observed = (first, angle) if behavior != "approaching" else (angle, first)
            mirrored = (first, -angle) if behavior != "approaching" else (-angle, -first)
            left, right = law(observed)
            assert law(mirrored) == pytest.approx((right, left))


def test_the_hand_answers_what_it_saw_some_steps_ago() -> None:
    hand = Hand(lambda seen: (seen[0], -seen[0]), Habits(2, 0.0, 0.0, 0.0), np.random.default_rng(0))
    assert [hand.command((float(k), 0.0))[0] for k in range(5)] == [0.0, 0.0, 0.0, 1.0, 2.0]


def test_a_steady_hand_follows_the_law() -> None:
    hand = Hand(seek_ball, STEADY, np.random.default_rng(0))
    assert hand.command((0.7, 0.3)) == seek_ball((0.7, 0.3))


def test_the_same_generator_gives_the_same_commands_and_another_gives_others() -> None:
    def commands(seed: int) -> list[tuple[float, float]]:
        hand = Hand(seek_ball, Habits(), np.random.default_rng(seed))
        return [hand.command((1.0, 0.01 * k)) for k in range(50)]

    assert commands(1) == commands(1)
    assert commands(1) != commands(2)


def test_the_noise_is_smooth_and_as_large_as_it_says() -> None:
    habits = Habits(0, 0.0, 3.0, 0.9)
    hand = Hand(lambda _: (0.0, 0.0), habits, np.random.default_rng(1))
    left = np.array([hand.command((0.0, 0.0))[0] for _ in range(20_000)])
    assert left.std() == pytest.approx(3.0, rel=0.1)
    assert np.corrcoef(left[:-1], left[1:])[0, 1] == pytest.approx(0.9, abs=0.02)


def test_no_command_is_beyond_full() -> None:
    hand = Hand(lambda _: (1000.0, -1000.0), Habits(), np.random.default_rng(0))
    assert hand.command((0.0, 0.0)) == (MAX_WHEEL_RAD_S, -MAX_WHEEL_RAD_S)


def test_a_behavior_without_an_instructor_is_refused_with_the_known_ones() -> None:
    with pytest.raises(BadInput, match="'dance' has no scripted instructor; there is one for: approaching"):
        instructor_of("dance")


@pytest.mark.parametrize(
    ("law", "observed", "expected"),
    [
        (seek_ball, (9.0, 0.5), (65.0 * cos(0.5) - 9.0, 65.0 * cos(0.5) + 9.0)),
        (seek_ball, (9.0, 2.5), (-18.0, 18.0)),
        (avoid_wall, (0.2, 0.0), (-5.0, -55.0)),
        (avoid_wall, (0.21, 0.0), (50.0, 50.0)),
        (avoid_wall, (0.1, -1.2), (-55.0, -5.0)),
        (avoid_wall, (0.1, 1.3), (55.0, -5.0)),
        (avoid_wall, (0.1, pi / 2), (55.0, 55.0)),
        (approach, (0.0, 0.4), (60.0, 60.0)),
        (approach, (0.0, 0.0), (70.0, 70.0)),
        (approach, (-0.5, 0.9), (50.0 * cos(0.5) + 9.0, 50.0 * cos(0.5) - 9.0)),
    ],
)
def test_a_law_is_what_the_hand_computes(
    law: Law, observed: tuple[float, float], expected: tuple[float, float]
) -> None:
    assert law(observed) == pytest.approx(expected)


def test_a_command_is_the_law_times_the_gains_of_the_hand_plus_smooth_noise() -> None:
    habits = Habits(0, 0.1, 2.0, 0.8)
    hand, draw = Hand(lambda _: (20.0, -30.0), habits, np.random.default_rng(5)), np.random.default_rng(5)
    gains, noise = 1.0 + 0.1 * draw.standard_normal(2), 2.0 * draw.standard_normal(2)
    for _ in range(3):
        noise = 0.8 * noise + 2.0 * 0.6 * draw.standard_normal(2)
        assert hand.command((0.0, 0.0)) == pytest.approx(np.array([20.0, -30.0]) * gains + noise)


def test_the_usual_hand_is_the_one_that_the_documents_describe() -> None:
    assert Habits() == Habits(2, 0.08, 0.5 * LEVEL_RAD_S, 0.9)


def test_a_behavior_with_an_instructor_has_its_law() -> None:
    assert [instructor_of(behavior) for behavior in INSTRUCTORS] == [seek_ball, avoid_wall, approach]
