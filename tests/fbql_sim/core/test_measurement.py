"""What is measured: independent errors of the deviations that are asked for, and the true state where there are none."""

from __future__ import annotations

from dataclasses import replace
from math import pi
from statistics import mean, stdev

import pytest
from fbql_common.core.walls import closest_wall_point
from fbql_sim.core.measurement import Measurement
from fbql_sim.core.parameters import SimulationParameters
from fbql_sim.core.world_loop import WorldLoop

DEFAULTS = SimulationParameters()
NOISY = replace(DEFAULTS, position_noise_m=0.01, yaw_noise_rad=0.02, speed_noise_m_s=0.03, yaw_rate_noise_rad_s=0.04)
TRUE = WorldLoop(DEFAULTS).reset(0, 4)._replace(robot_yaw_rad=1.0, robot_speed_m_s=0.4, ball_vx_m_s=-0.8)
DEVIATIONS = {
    "robot_x_m": 0.01, "robot_y_m": 0.01, "robot_yaw_rad": 0.02, "robot_speed_m_s": 0.03, "robot_yaw_rate_rad_s": 0.04,
    "ball_x_m": 0.01, "ball_y_m": 0.01, "ball_vx_m_s": 0.03, "ball_vy_m_s": 0.03,
}  # fmt: skip


def test_every_number_has_an_error_of_its_own_with_the_deviation_of_its_kind() -> None:
    measurement = Measurement(NOISY)
    measurement.begin(3)
    found = [measurement.of(TRUE) for _ in range(3000)]
    errors = {name: [getattr(each, name) - getattr(TRUE, name) for each in found] for name in DEVIATIONS}
    for name, deviation in DEVIATIONS.items():
        assert mean(errors[name]) == pytest.approx(0.0, abs=deviation / 10)
        assert stdev(errors[name]) == pytest.approx(deviation, rel=0.1)
    assert abs(mean(a * b for a, b in zip(errors["robot_x_m"], errors["robot_y_m"], strict=True))) < 0.1 * 0.01**2
    walls = {"wall_x_m", "wall_y_m", "wall_yaw_rad"}
    for name in set(TRUE._fields) - set(DEVIATIONS) - walls:
        assert {getattr(each, name) for each in found} == {getattr(TRUE, name)}


def test_a_measured_yaw_stays_within_half_a_turn() -> None:
    measurement = Measurement(replace(DEFAULTS, yaw_noise_rad=0.5))
    yaws = [measurement.of(TRUE._replace(robot_yaw_rad=pi)).robot_yaw_rad for _ in range(200)]
    assert all(-pi < yaw <= pi for yaw in yaws)
    assert min(yaws) < 0.0 < max(yaws)


def test_a_seed_decides_the_errors() -> None:
    def measured(seed: int) -> list[float]:
        loop = WorldLoop(NOISY)
        worlds = [loop.reset(0, 7), loop.reset(0, seed), loop.step(20.0, 20.0)]
        return [world.robot_x_m for world in worlds[1:]]

    assert measured(1) == measured(1)
    assert measured(1) != measured(2)


def test_errors_change_what_is_seen_and_not_what_happens() -> None:
    loops = WorldLoop(DEFAULTS), WorldLoop(NOISY)
    starts = [loop.reset(0, 5) for loop in loops]
    seen: list[float] = []
    for _ in range(200):
        true, measured = (loop.step(30.0, 29.0) for loop in loops)
        seen.append(measured.robot_x_m - true.robot_x_m)
        assert (true.collision, true.goal, true.step) == (measured.collision, measured.goal, measured.step)
    assert stdev(seen) == pytest.approx(0.01, rel=0.3)
    assert starts[0].ball_x_m != starts[1].ball_x_m
    x, y = measured.robot_x_m, measured.robot_y_m
    assert (measured.wall_x_m, measured.wall_y_m, measured.wall_yaw_rad) == closest_wall_point(x, y)


def test_without_noise_the_true_state_is_measured() -> None:
    assert Measurement(DEFAULTS).is_exact
    assert not Measurement(replace(DEFAULTS, yaw_rate_noise_rad_s=0.1)).is_exact
