"""The physics against the match logs (reference: 12 FIRA 2019 logs) and against motions computed by hand."""

from __future__ import annotations

from dataclasses import replace
from math import atan2, cos, hypot, pi, radians, sin, tau
from statistics import median

import pytest
from fbql_common.core.field import AXLE_M, BALL_RADIUS_M, FIELD, MAX_WHEEL_RAD_S, ROBOT_SIDE_M, WHEEL_RADIUS_M
from fbql_common.core.geometry import wrap_angle
from fbql_common.core.walls import HALF_GOAL, HALF_LENGTH, HALF_WIDTH, POCKET, SIDE_END
from fbql_sim.core.parameters import SimulationParameters
from fbql_sim.core.physics import Physics, Start
from hypothesis import given, settings
from hypothesis import strategies as st

LOG_CYCLE_S = 1 / 40
DEFAULTS = SimulationParameters()
HALF_ROBOT = ROBOT_SIDE_M / 2
FAR_AWAY = (-1.0, 0.0)


def physics_with(start: Start, **changes: float) -> Physics:
    physics = Physics(replace(DEFAULTS, **changes))
    physics.reset(start)
    return physics


def rolling_ball(x: float, y: float, speed: float, direction: float, **changes: float) -> Physics:
    return physics_with(Start(*FAR_AWAY, 0.0, x, y, speed * cos(direction), speed * sin(direction)), **changes)


def robot_alone(x: float, y: float, yaw: float, **changes: float) -> Physics:
    """The robot, with the ball out of its way."""
    return physics_with(Start(x, y, yaw, 0.9 if x < 0 else -0.9, 0.6 if y < 0 else -0.6), **changes)


def drive(physics: Physics, left: float, right: float, steps: int) -> None:
    for _ in range(steps):
        physics.step(left, right)


def depth_outside(x: float, y: float) -> float:
    """How far a point is beyond the walls, negative inside (exact near the walls but for their corners) [m]."""
    x, y = abs(x), abs(y)
    field = max(x - HALF_LENGTH, y - HALF_WIDTH, (x + y - SIDE_END - HALF_WIDTH) / 2**0.5)
    return min(field, max(x - POCKET, y - HALF_GOAL))


# The measured data


def restitution(speed: float, angle: float, start_y: float, dt_s: float) -> float:
    """Speed normal to the side wall in the step after the bounce, divided by that in the step before it."""
    physics = rolling_ball(0.0, start_y, speed, pi / 2 - angle, dt_s=dt_s)
    before = 0.0
    for _ in range(round(2.0 / dt_s)):
        before = physics.ball_vy_m_s
        physics.step(0.0, 0.0)
        if physics.ball_vy_m_s < 0.0:
            return -physics.ball_vy_m_s / before
    raise AssertionError("the ball never came off the wall")


@pytest.mark.parametrize("dt_s", [1 / 30, 1 / 40, 1 / 60, 1 / 120, 1 / 240])
def test_ball_comes_off_a_wall_with_the_measured_restitution(dt_s: float) -> None:
    measured = [
        restitution(speed, radians(angle), start_y, dt_s)
        for speed in (0.5, 1.0, 2.0, 3.0)
        for angle in (0.0, 30.0, 60.0)
        for start_y in (0.75, 0.77, 0.79)
    ]
    assert all(0.446 <= value <= 0.458 for value in measured)
    assert median(measured) == pytest.approx(0.450, abs=0.003)


@pytest.mark.parametrize("speed", [0.3, 1.0, 2.2])
@pytest.mark.parametrize("dt_s", [1 / 40, 1 / 60, 1 / 120, 0.01])
def test_rolling_ball_keeps_the_measured_share_of_its_speed_per_log_cycle(dt_s: float, speed: float) -> None:
    physics = rolling_ball(-0.5, 0.1, speed, 0.2, dt_s=dt_s)
    steps = round(0.3 / dt_s)
    drive(physics, 0.0, 0.0, steps)
    kept = hypot(physics.ball_vx_m_s, physics.ball_vy_m_s) / speed
    assert kept ** (LOG_CYCLE_S / (steps * dt_s)) == pytest.approx(0.9916, abs=1e-5)


def test_a_slow_ball_comes_fully_to_rest() -> None:
    physics = rolling_ball(0.0, 0.0, 0.05, 0.0)
    drive(physics, 0.0, 0.0, round(10 / DEFAULTS.dt_s))
    assert (physics.ball_vx_m_s, physics.ball_vy_m_s) == (0.0, 0.0)
    resting = physics.ball_x_m
    drive(physics, 0.0, 0.0, 100)
    assert physics.ball_x_m == resting


def test_robot_reaches_full_speed_in_the_measured_number_of_log_cycles() -> None:
    physics = robot_alone(-1.0, 0.0, 0.0, dt_s=LOG_CYCLE_S)
    cycles = 0
    while physics.robot_speed_m_s < 0.999 * MAX_WHEEL_RAD_S * WHEEL_RADIUS_M:
        physics.step(MAX_WHEEL_RAD_S, MAX_WHEEL_RAD_S)
        cycles += 1
        assert cycles <= 16
    assert cycles >= 10


# Motions computed by hand


@pytest.mark.parametrize("dt_s", [1 / 40, 1 / 60, 1 / 200])
def test_straight_drive_covers_the_distance_of_its_acceleration_ramp(dt_s: float) -> None:
    physics = robot_alone(-1.0, 0.0, 0.0, dt_s=dt_s)
    speed, acceleration, duration = 50 * WHEEL_RADIUS_M, DEFAULTS.wheel_acceleration_m_s2, 1.0
    drive(physics, 50, 50, round(duration / dt_s))
    ramp = speed / acceleration
    # the speed is set at the start of a step: at most one step's gain more than the continuous ramp
    assert physics.robot_x_m + 1.0 == pytest.approx(speed * (duration - ramp / 2), abs=speed * dt_s)
    assert physics.robot_y_m == pytest.approx(0.0, abs=1e-12)
    assert physics.robot_speed_m_s == pytest.approx(speed, abs=1e-12)


def test_each_step_changes_a_wheels_speed_by_no_more_than_the_limit() -> None:
    physics = robot_alone(-0.5, 0.0, 0.0)
    limit = DEFAULTS.wheel_acceleration_m_s2 * DEFAULTS.dt_s
    left = right = 0.0
    for command in [(88, 88)] * 10 + [(-88, 88)] * 10 + [(0, 0)] * 10 + [(20, -5)] * 10:
        physics.step(*command)
        turn = physics.robot_yaw_rate_rad_s * AXLE_M / 2
        now_left, now_right = physics.robot_speed_m_s - turn, physics.robot_speed_m_s + turn
        # a turning robot's heading leaves its velocity behind, which costs forward speed beyond the limit
        lost = abs(physics.robot_slip_m_s) + 1e-9
        assert abs(now_left - left) <= limit + lost
        assert abs(now_right - right) <= limit + lost
        left, right = now_left, now_right


def test_turning_in_place_has_the_rate_of_the_wheels_and_stays_in_place() -> None:
    physics = robot_alone(0.0, 0.0, 0.0)
    drive(physics, -10, 10, 60)
    rate = 2 * 10 * WHEEL_RADIUS_M / AXLE_M
    assert physics.robot_yaw_rate_rad_s == pytest.approx(rate)
    before = physics.robot_yaw_rad
    physics.step(-10, 10)
    assert wrap_angle(physics.robot_yaw_rad - before) == pytest.approx(rate * DEFAULTS.dt_s)
    assert hypot(physics.robot_x_m, physics.robot_y_m) < 1e-9


def test_a_gentle_arc_has_the_radius_of_its_wheel_speeds() -> None:
    radius, speed = 0.3, 0.5
    turn = speed / radius
    left, right = ((speed + side * turn * AXLE_M / 2) / WHEEL_RADIUS_M for side in (-1, 1))
    physics = robot_alone(-0.5, -0.3, 0.0)
    drive(physics, left, right, 20)
    centre_x = physics.robot_x_m - radius * sin(physics.robot_yaw_rad)
    centre_y = physics.robot_y_m + radius * cos(physics.robot_yaw_rad)
    for _ in range(round(tau / turn / DEFAULTS.dt_s)):
        physics.step(left, right)
        assert hypot(physics.robot_x_m - centre_x, physics.robot_y_m - centre_y) == pytest.approx(radius, rel=0.03)


def circle_diameter(grip: float) -> float:
    """Diameter of the circle driven at 1 m/s and 5 rad/s, which takes 5 m/s^2 towards its centre [m]."""
    left, right = ((1.0 + side * 5.0 * AXLE_M / 2) / WHEEL_RADIUS_M for side in (-1, 1))
    physics = robot_alone(-0.2, -0.2, 0.0, lateral_grip_m_s2=grip)
    drive(physics, left, right, 60)
    y = list[float]()
    for _ in range(120):
        physics.step(left, right)
        y.append(physics.robot_y_m)
        assert not physics.robot_touched_wall
    return max(y) - min(y)


def test_wheels_hold_sideways_within_their_grip_and_slide_beyond_it() -> None:
    assert circle_diameter(DEFAULTS.lateral_grip_m_s2) == pytest.approx(0.4, rel=0.02)
    assert circle_diameter(4.0) > 0.5


def test_wheel_commands_are_clipped_to_the_fastest_wheel() -> None:
    asked, fastest = robot_alone(-1.0, 0.0, 0.0), robot_alone(-1.0, 0.0, 0.0)
    drive(asked, 1e9, 1e300, 50)
    drive(fastest, MAX_WHEEL_RAD_S, MAX_WHEEL_RAD_S, 50)
    assert asked.robot_x_m == fastest.robot_x_m
    assert asked.robot_speed_m_s == pytest.approx(MAX_WHEEL_RAD_S * WHEEL_RADIUS_M)


def test_a_robot_stopped_by_a_wall_starts_again_from_standstill() -> None:
    physics = robot_alone(0.95, 0.5, 0.0)
    drive(physics, 88, 88, 60)
    assert physics.robot_touched_wall
    assert abs(physics.robot_speed_m_s) < 0.02
    physics.step(-88, -88)
    limit = DEFAULTS.wheel_acceleration_m_s2 * DEFAULTS.dt_s
    assert -limit - 0.02 <= physics.robot_speed_m_s <= -limit + 0.02


def test_a_pushed_ball_moves_along_with_the_robot() -> None:
    physics = physics_with(Start(-0.5, 0.0, 0.0, -0.35, 0.0))
    drive(physics, 30, 30, 60)
    assert physics.ball_vx_m_s >= 0.95 * physics.robot_speed_m_s > 0.5
    assert physics.ball_y_m == pytest.approx(0.0, abs=1e-6)


# Contacts


def test_the_step_in_which_a_robot_comes_to_a_wall_is_a_step_in_contact() -> None:
    physics = robot_alone(0.9, 0.5, 0.0)
    while not physics.robot_touched_wall:
        before = physics.robot_x_m
        physics.step(88, 88)
    assert before + HALF_ROBOT < HALF_LENGTH - physics.robot_speed_m_s * DEFAULTS.dt_s / 2, "it was still on its way"
    assert physics.robot_x_m + HALF_ROBOT == pytest.approx(HALF_LENGTH, abs=0.001)


def test_neither_a_ball_at_a_wall_nor_a_robot_at_the_ball_is_a_contact_of_the_robot_with_a_wall() -> None:
    rolling, pushing = rolling_ball(0.9, 0.5, 1.0, 0.0), physics_with(Start(-0.5, 0.0, 0.0, -0.35, 0.0))
    for _ in range(60):
        rolling.step(0, 0)
        pushing.step(30, 30)
        assert not rolling.robot_touched_wall and not pushing.robot_touched_wall
    assert rolling.ball_vx_m_s < 0.0, "it came off the wall"
    assert pushing.ball_vx_m_s > 0.5, "it was pushed"


def test_a_touch_that_begins_and_ends_within_a_step_is_a_contact() -> None:
    """A robot that turns beside a wall grazes it with its corner: in some steps only between two worlds."""
    physics = robot_alone(0.0, HALF_WIDTH - HALF_ROBOT * 2**0.5 + 0.0001, 0.0)
    touched: list[bool] = []
    for _ in range(240):
        physics.step(-20, 20)
        touched.append(physics.robot_touched_wall)
    assert any(touched)
    assert not all(touched)


def test_a_robot_pressed_against_a_wall_is_in_contact_in_every_step_and_in_none_after_a_reset() -> None:
    physics = robot_alone(0.95, 0.5, 0.0)
    drive(physics, 60, 60, 60)
    for _ in range(60):
        physics.step(60, 60)
        assert physics.robot_touched_wall
    physics.reset(Start(0.0, 0.0, 0.0, 0.5, 0.0))
    assert not physics.robot_touched_wall
    physics.step(0, 0)
    assert not physics.robot_touched_wall


# Walls hold, and let go

WALL_PLACES = [
    pytest.param((0.3, 0.8), pi / 2, id="side"),
    pytest.param((1.0, 0.5), 0.0, id="end"),
    pytest.param((-1.0, -0.5), pi, id="own end"),
    pytest.param((1.02, -0.82), -pi / 4, id="corner"),
    pytest.param((-1.1, 0.0), pi, id="own goal"),
]


@pytest.mark.parametrize(("place", "into"), WALL_PLACES)
@pytest.mark.parametrize("way", ["turn", "back off"])
@pytest.mark.parametrize("slant", [0.0, 0.3])
def test_a_robot_pressed_against_a_wall_gets_away(
    place: tuple[float, float], into: float, way: str, slant: float
) -> None:
    physics = robot_alone(*place, into + slant)
    drive(physics, 60, 60, 90)
    assert physics.robot_touched_wall
    if way == "turn":
        steps = 0
        while abs(wrap_angle(physics.robot_yaw_rad - into)) < 0.9 * pi:
            physics.step(-25, 25)
            steps += 1
            assert steps < 90, f"after turning for 1.5 s the heading is still {physics.robot_yaw_rad:.2f} rad"
        drive(physics, 0, 0, 10)
    x, y = physics.robot_x_m, physics.robot_y_m
    drive(physics, *((40, 40) if way == "turn" else (-40, -40)), 20)
    assert hypot(physics.robot_x_m - x, physics.robot_y_m - y) > 0.08
    assert not physics.robot_touched_wall


commands = st.lists(
    st.tuples(st.floats(-88, 88), st.floats(-88, 88), st.integers(1, 60), st.booleans()), min_size=1, max_size=12
)


@settings(deadline=None, max_examples=150)
@given(commands, st.floats(-1.0, 1.0), st.floats(-0.8, 0.8), st.floats(-3.0, 3.0), st.floats(-3.0, 3.0))
def test_robot_and_ball_stay_inside_the_walls(
    commands: list[tuple[float, float, int, bool]], ball_x: float, ball_y: float, vx: float, vy: float
) -> None:
    physics = physics_with(Start(-1.04, 0.0, 0.0, max(ball_x, -0.95), ball_y, vx, vy))
    for left, right, steps, chase in commands:
        for _ in range(steps):
            if chase:  # towards the ball as fast as possible, to squeeze it against walls
                to_ball = atan2(physics.ball_y_m - physics.robot_y_m, physics.ball_x_m - physics.robot_x_m)
                turn = 40 * wrap_angle(to_ball - physics.robot_yaw_rad)
                left, right = 88 - turn, 88 + turn
            physics.step(left, right)
            cosine, sine = HALF_ROBOT * cos(physics.robot_yaw_rad), HALF_ROBOT * sin(physics.robot_yaw_rad)
            for along, across in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
                corner_x = physics.robot_x_m + along * cosine - across * sine
                corner_y = physics.robot_y_m + along * sine + across * cosine
                assert depth_outside(corner_x, corner_y) < 0.01
            assert depth_outside(physics.ball_x_m, physics.ball_y_m) < -BALL_RADIUS_M + 0.016


@pytest.mark.parametrize("speed", [3.0, 6.0, 10.0])
def test_a_fast_ball_passes_through_no_wall(speed: float) -> None:
    deepest = speed * DEFAULTS.physics_step_s - BALL_RADIUS_M
    for direction in range(0, 360, 7):
        physics = rolling_ball(0.0, 0.3, speed, radians(direction))
        for _ in range(60):
            physics.step(0.0, 0.0)
            assert depth_outside(physics.ball_x_m, physics.ball_y_m) < deepest
        drive(physics, 0.0, 0.0, 300)  # until it is slow, and no bounce is deep
        assert depth_outside(physics.ball_x_m, physics.ball_y_m) < 0.003 - BALL_RADIUS_M


@pytest.mark.parametrize("speed", [0.3, 3.0, 10.0])
@pytest.mark.parametrize("side", [-1, 1])
def test_a_ball_in_a_goal_is_seen_past_the_line_at_any_speed(speed: float, side: int) -> None:
    for number in range(20):
        physics = physics_with(Start(0.0, 0.0, 0.0, side * (0.9 + number * 0.005), 0.05, side * speed, 0.0))
        seen = False
        for _ in range(120):
            physics.step(0.0, 0.0)
            seen = seen or side * physics.ball_x_m > FIELD.half_length_m + BALL_RADIUS_M
        assert seen
