"""From keys to velocity commands: steps, limits, and rest when the keys are released."""

from __future__ import annotations

import pytest
from fbql_behaviors.core.teleop import Teleop, TeleopParameters
from fbql_common.core.twist import Twist
from hypothesis import given
from hypothesis import strategies as st

PARAMETERS = TeleopParameters(max_linear_m_s=1.0, max_angular_rad_s=2.0, steps=4, release_s=0.5)


def test_each_press_is_a_step_up_to_the_limit_in_every_direction() -> None:
    teleop = Teleop(PARAMETERS)
    speeds: list[float] = []
    for _ in range(6):
        teleop.drive(1, 0.0)
        speeds.append(teleop.command(0.0).linear_x_m_s)
    assert speeds == [0.25, 0.5, 0.75, 1.0, 1.0, 1.0]
    for _ in range(20):
        teleop.drive(-1, 0.0)
        teleop.turn(-1, 0.0)
    assert teleop.command(0.0) == Twist(linear_x_m_s=-1.0, angular_z_rad_s=-2.0)


def test_left_is_counter_clockwise() -> None:
    teleop = Teleop(PARAMETERS)
    teleop.turn(1, 0.0)
    assert teleop.command(0.0) == Twist(angular_z_rad_s=0.5)


def test_a_turn_to_the_other_side_begins_at_once() -> None:
    teleop = Teleop(PARAMETERS)
    for _ in range(4):
        teleop.turn(1, 0.0)
    teleop.turn(-1, 0.1)
    assert teleop.command(0.1).angular_z_rad_s == -0.5


@pytest.mark.parametrize(("later_s", "moves"), [(0.5, True), (0.51, False)])
def test_the_robot_rests_when_no_key_was_pressed_for_the_time_of_a_release(later_s: float, moves: bool) -> None:
    teleop = Teleop(PARAMETERS)
    teleop.drive(1, 0.0)
    teleop.turn(1, 0.0)
    assert (teleop.command(later_s) != Twist()) is moves


def test_a_turn_ends_while_the_speed_is_held_and_keeps_the_speed_while_it_is_held() -> None:
    teleop = Teleop(PARAMETERS)
    teleop.turn(1, 0.0)
    for tenth in range(1, 8):
        teleop.drive(1, tenth / 10)
    assert teleop.command(0.7) == Twist(linear_x_m_s=1.0)
    for tenth in range(7, 20):
        teleop.turn(1, tenth / 10)
    assert teleop.command(1.9) == Twist(linear_x_m_s=1.0, angular_z_rad_s=2.0)


def test_a_press_after_a_release_begins_from_rest() -> None:
    teleop = Teleop(PARAMETERS)
    for _ in range(4):
        teleop.drive(1, 0.0)
    teleop.drive(-1, 5.0)
    assert teleop.command(5.0) == Twist(linear_x_m_s=-0.25)


def test_stop_stops_at_once() -> None:
    teleop = Teleop(PARAMETERS)
    teleop.drive(1, 0.0)
    teleop.turn(1, 0.0)
    teleop.stop()
    assert teleop.command(0.0) == Twist()


@given(st.lists(st.tuples(st.sampled_from(["drive", "turn"]), st.sampled_from([-1, 1]), st.floats(0.0, 1.0))))
def test_no_keys_lead_beyond_the_limits(presses: list[tuple[str, int, float]]) -> None:
    teleop, now_s = Teleop(PARAMETERS), 0.0
    for what, direction, pause_s in presses:
        now_s += pause_s
        getattr(teleop, what)(direction, now_s)
        command = teleop.command(now_s)
        assert abs(command.linear_x_m_s) <= 1.0
        assert abs(command.angular_z_rad_s) <= 2.0
    assert teleop.command(now_s + 0.6) == Twist()
