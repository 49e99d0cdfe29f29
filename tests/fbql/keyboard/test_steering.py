"""From keys to wheel velocities."""

from __future__ import annotations

from collections.abc import Iterable

import pytest
from fbql.keyboard.steering import (
    FASTEST_BACK_LEVEL,
    FASTEST_LEVEL,
    HOLD_S,
    REPEAT_S,
    STRONGER_S,
    STRONGEST_TURN,
    Steering,
)
from fbql_behaviors.core.quantizer import levels_of, rad_s_of, wheel_class_of
from fbql_common.terminal.keys import DRIVING, Key
from hypothesis import given
from hypothesis import strategies as st


def pressed(keys: Iterable[tuple[Key, float]]) -> Steering:
    driving = Steering()
    for key, now_s in keys:
        driving.press(key, now_s)
    return driving


def test_each_press_changes_the_speed_by_a_level_and_it_stays() -> None:
    driving = pressed([(Key.FASTER, 0.0), (Key.FASTER, 0.1), (Key.FASTER, 0.2), (Key.SLOWER, 0.3)])
    assert driving.levels(60.0) == (2, 2)
    assert driving.command(60.0) == (rad_s_of(2), rad_s_of(2))


def test_speed_is_limited_forwards_and_backwards() -> None:
    assert pressed([(Key.FASTER, 0.0)] * 50).speed == FASTEST_LEVEL
    assert pressed([(Key.SLOWER, 0.0)] * 50).speed == -FASTEST_BACK_LEVEL


def test_a_tap_turns_for_a_moment_and_then_it_goes_straight_on() -> None:
    driving = pressed([(Key.FASTER, 0.0), (Key.FASTER, 0.0), (Key.LEFT, 1.0)])
    assert driving.levels(1.0 + HOLD_S / 2) == (1, 2)
    assert driving.levels(1.0 + 1.01 * HOLD_S) == (2, 2)


@pytest.mark.parametrize("repeat_s", [1 / 30, 0.1])
def test_a_key_that_is_held_turns_without_a_gap_and_stronger_with_time(repeat_s: float) -> None:
    driving = Steering()
    turns: list[int] = []
    now_s = 0.0
    while now_s < 1.0:
        driving.press(Key.RIGHT, now_s)
        turns += [driving.turn(now_s), driving.turn(now_s + 0.99 * repeat_s)]
        now_s += repeat_s
    assert turns == sorted(turns, reverse=True)
    assert set(turns) == {-1, -2, -STRONGEST_TURN}


def test_a_turn_begins_gently_again_after_a_pause_and_on_the_other_side() -> None:
    held = [(Key.LEFT, 0.1 * k) for k in range(10)]
    assert pressed(held).turn(0.9) == STRONGEST_TURN
    assert pressed([*held, (Key.RIGHT, 0.95)]).turn(0.95) == -1
    after_s = 0.9 + 1.01 * REPEAT_S
    assert pressed([*held, (Key.LEFT, after_s)]).turn(after_s) == 1


def test_left_is_counter_clockwise_and_the_mirror_of_right() -> None:
    for speed in range(-3, 4):
        keys = [(Key.FASTER if speed > 0 else Key.SLOWER, 0.0)] * abs(speed)
        for held in (0, 1, 2):
            begun = [(0.1 * k) for k in range(1 + round(held * STRONGER_S / 0.1 + 0.5))]
            left = pressed([*keys, *((Key.LEFT, time) for time in begun)]).levels(begun[-1])
            right = pressed([*keys, *((Key.RIGHT, time) for time in begun)]).levels(begun[-1])
            assert left == right[::-1]
            assert left[1] > left[0]


def test_space_stops_everything() -> None:
    assert pressed([(Key.FASTER, 0.0), (Key.LEFT, 0.1), (Key.STOP, 0.1)]).command(0.1) == (0.0, 0.0)


@given(st.lists(st.tuples(st.sampled_from(sorted(DRIVING, key=lambda key: key.name)), st.floats(0.0, 0.3))))
def test_what_is_driven_is_exactly_a_wheel_class(presses: list[tuple[Key, float]]) -> None:
    driving, now_s = Steering(), 0.0
    for key, pause_s in presses:
        now_s += pause_s
        driving.press(key, now_s)
        left, right = driving.levels(now_s)
        assert levels_of(wheel_class_of(*driving.command(now_s))) == (left, right)
        assert -FASTEST_BACK_LEVEL - 2 <= min(left, right) <= max(left, right) <= FASTEST_LEVEL + 1
