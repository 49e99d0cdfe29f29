"""The loop's contract: worlds in sequence, the same from the same seed, ends of two kinds, refused commands."""

from __future__ import annotations

import gc
import hashlib
import os
import random
import subprocess
import sys
from dataclasses import replace
from math import hypot, inf, nan, pi

import pytest
from fbql_common.core.field import MAX_WHEEL_RAD_S
from fbql_common.core.types import World
from fbql_common.core.walls import closest_wall_point
from fbql_sim.core.parameters import SimulationParameters
from fbql_sim.core.scripted_law import law
from fbql_sim.core.world_loop import WorldLoop
from patience import PATIENCE_S

DEFAULTS = SimulationParameters()


def play(loop: WorldLoop, seed: int, steps: int = 300) -> list[World]:
    """Random driving, the same for the same seed: bumps into walls and the ball."""
    rng = random.Random(seed)
    worlds = [loop.reset(seed, seed)]
    while len(worlds) <= steps and not worlds[-1].ended:
        if len(worlds) % 20 == 1:
            command = (rng.uniform(-30, 88), rng.uniform(-30, 88))
        worlds.append(loop.step(*command))
    return worlds


def without_stamp(worlds: list[World]) -> list[tuple[object, ...]]:
    return [world[1:] for world in worlds]


def test_worlds_are_counted_from_the_reset_and_time_never_goes_back() -> None:
    loop = WorldLoop()
    worlds = play(loop, 1, 50) + play(loop, 2, 50)
    assert [world.step for world in worlds] == [*range(51), *range(51)]
    assert [world.episode for world in worlds] == [1] * 51 + [2] * 51
    assert [world.stamp_ns for world in worlds] == [round(k * 1e9 / 60) for k in range(1, 103)]
    assert loop.world is worlds[-1]
    assert loop.dt_s == 1 / 60


def test_a_world_has_a_value_for_each_of_its_fields_and_no_more() -> None:
    loop = WorldLoop()
    for world in (loop.reset(0, seed=0), loop.step(10.0, 10.0)):
        assert type(world) is World
        assert len(world) == len(World._fields)
        assert World(*world) == world


def test_a_reset_shows_the_start_at_rest_without_events() -> None:
    world = WorldLoop().reset(4, 9)
    assert (world.episode, world.step) == (4, 0)
    assert world.robot_speed_m_s == world.robot_yaw_rate_rad_s == world.ball_vx_m_s == world.ball_vy_m_s == 0.0
    assert not any((world.goal, world.own_goal, world.collision_begun, world.collision))
    assert not world.ended


def test_a_world_holds_the_closest_wall_point_of_its_robot() -> None:
    for world in play(WorldLoop(), 5):
        expected = closest_wall_point(world.robot_x_m, world.robot_y_m)
        assert (world.wall_x_m, world.wall_y_m, world.wall_yaw_rad) == expected
        assert -pi < world.robot_yaw_rad <= pi


# Determinism


def test_the_same_seed_gives_the_same_worlds_whatever_was_played_before() -> None:
    fresh = {seed: without_stamp(play(WorldLoop(), seed)) for seed in range(4)}
    assert any(world[16] for world in fresh[0] + fresh[1] + fresh[2] + fresh[3]), "no collision, nothing to leak"
    loop = WorldLoop()
    for seed in (3, 1, 0, 2, 1, 3):
        assert without_stamp(play(loop, seed)) == fresh[seed]
        play(loop, 100 + seed, steps=137)


def test_an_old_episode_that_is_freed_late_does_not_disturb_the_new_one() -> None:
    """The physics of an episode that ended in contact with a wall ends that contact when it is freed."""
    loop = WorldLoop()
    gc.disable()
    try:
        loop.reset(0, 0)
        while not loop.world.collision:
            loop.step(40.0, 30.0)
        loop.reset(1, 1)
        while not loop.world.collision:
            loop.step(40.0, 30.0)
        gc.collect()
        for _ in range(5):
            assert loop.step(40.0, 30.0).collision
    finally:
        gc.enable()


def test_another_process_plays_the_same_worlds() -> None:
    program = (
        "from fbql_sim.core.world_loop import WorldLoop\n"
        "loop = WorldLoop(); loop.reset(0, 3)\n"
        "for k in range(400): world = loop.step(60.0 + k % 7, 60.0)\n"
        "print(repr(tuple(world)))"
    )
    loop = WorldLoop()
    play(loop, 8)
    loop = WorldLoop()
    loop.reset(0, 3)
    for k in range(400):
        loop.step(60.0 + k % 7, 60.0)
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    other = subprocess.run(
        [sys.executable, "-c", program], env=environment, capture_output=True, text=True, timeout=PATIENCE_S, check=True
    )
    assert other.stdout.strip() == repr(tuple(loop.world))


def test_different_seeds_give_different_episodes() -> None:
    loop = WorldLoop()
    starts = {loop.reset(0, seed)[3:11] for seed in range(50)}
    assert len(starts) == 50


# Ends and refusals


def test_the_time_limit_truncates_and_the_next_step_is_refused_until_reset() -> None:
    loop = WorldLoop(replace(DEFAULTS, max_steps=5))
    worlds = play(loop, 0)
    assert [(world.terminated, world.truncated) for world in worlds] == [(False, False)] * 5 + [(False, True)]
    with pytest.raises(RuntimeError, match="ended at step 5"):
        loop.step(0.0, 0.0)
    loop.reset(1, 1)
    assert loop.step(0.0, 0.0).step == 1


def test_nothing_runs_before_the_first_reset() -> None:
    loop = WorldLoop()
    with pytest.raises(RuntimeError, match="reset"):
        loop.step(0.0, 0.0)
    with pytest.raises(RuntimeError, match="reset"):
        _ = loop.world


@pytest.mark.parametrize("command", [(nan, 0.0), (0.0, inf), (-inf, nan)])
def test_a_wheel_command_that_is_not_finite_is_refused_and_moves_nothing(command: tuple[float, float]) -> None:
    loop, twin = WorldLoop(), WorldLoop()
    for one in (loop, twin):
        one.reset(0, 7)
        one.step(10.0, 20.0)
    before = loop.world
    with pytest.raises(ValueError, match="finite"):
        loop.step(*command)
    assert loop.world is before
    assert loop.step(5.0, 5.0) == twin.step(5.0, 5.0)


def test_a_huge_wheel_command_is_full_speed() -> None:
    loop = WorldLoop(replace(DEFAULTS, wheel_gain_deviation=0.0, wheel_noise_deviation=0.0))
    twin = WorldLoop(replace(DEFAULTS, wheel_gain_deviation=0.0, wheel_noise_deviation=0.0))
    for one in (loop, twin):
        one.reset(0, 7)
    assert loop.step(1.7e308, 1e300) == twin.step(MAX_WHEEL_RAD_S, MAX_WHEEL_RAD_S)


# Events through the whole loop


def drive_until_wall(loop: WorldLoop, speed: float) -> int:
    for count in range(400):
        if loop.step(speed, speed).collision_begun:
            return count
    raise AssertionError("no collision in 400 steps")


def test_pressing_against_a_wall_is_one_collision_and_coming_back_another() -> None:
    loop = WorldLoop()
    loop.reset(0, 5)
    drive_until_wall(loop, -30.0)
    assert loop.world.collision
    pressed = [loop.step(-30.0, -30.0) for _ in range(60)]
    assert all(world.collision for world in pressed[10:])
    assert not any(world.collision_begun for world in pressed)
    away = [loop.step(30.0, 30.0) for _ in range(20)]
    assert not away[-1].collision
    assert drive_until_wall(loop, -30.0) > 0


def test_scraping_along_a_wall_is_one_collision() -> None:
    loop = WorldLoop(replace(DEFAULTS, start_yaw_jitter_rad=0.0, wheel_gain_deviation=0.0))
    loop.reset(0, 4)
    begun = 0
    steps_in_contact = 0
    for _ in range(40):
        loop.step(20.0, 36.0)
    for _ in range(110):
        world = loop.step(40.0, 40.0)
        begun += world.collision_begun
        steps_in_contact += world.collision
    assert steps_in_contact > 10
    assert begun == 1


def test_the_contacts_of_fixed_seeds_are_pinned() -> None:
    """No digest of a match covers them, but collisions are counted from them and rewards are made of them."""
    loop, flags = WorldLoop(), hashlib.sha256()
    begun = steps_in_contact = steps = 0
    for seed in range(20):
        world = loop.reset(seed, seed)
        while not world.ended:
            world = loop.step(*law(world))
            steps += 1
            begun += world.collision_begun
            steps_in_contact += world.collision
            flags.update(bytes([world.collision, world.collision_begun]))
    assert (begun, steps_in_contact, steps) == (40, 204, 7457)
    assert flags.hexdigest() == "03c63236e9879f5f1ea1defc0622de0747cf576bd03fde971d7bea1df57c35b8"


def test_wall_contact_means_the_robot_is_at_a_wall() -> None:
    touched = 0
    for world in play(WorldLoop(), 2, 1500):
        distance = hypot(world.wall_x_m - world.robot_x_m, world.wall_y_m - world.robot_y_m)
        if world.collision:
            touched += 1
            assert distance < 0.075 / 2**0.5 + 0.03
        elif distance < 0.0375:
            pytest.fail(f"overlap without contact in step {world.step}")
    assert touched > 5


def test_resuming_goes_on_from_a_world_with_its_places_and_speeds() -> None:
    played, other = WorldLoop(), WorldLoop()
    world = played.reset(4, 11)
    for _ in range(40):
        world = played.step(60.0, 35.0)
    resumed = other.resume(world)
    assert resumed.episode == 4
    assert resumed.step == 0
    names = (
        "robot_x_m",
        "robot_y_m",
        "robot_yaw_rad",
        "robot_speed_m_s",
        "robot_yaw_rate_rad_s",
        "ball_x_m",
        "ball_y_m",
    )
    for name in (*names, "ball_vx_m_s", "ball_vy_m_s"):
        assert getattr(resumed, name) == pytest.approx(getattr(world, name), abs=1e-12), name
    assert other.resume(world)[1:] == resumed[1:], "whatever was played before"
