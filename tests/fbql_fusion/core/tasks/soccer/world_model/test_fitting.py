"""The fit, to real steps of the simulator and to made-up ones whose law is known."""

from __future__ import annotations

from dataclasses import replace
from math import exp, remainder, tau

import numpy as np
import pytest
from fbql_common.core.field import MAX_WHEEL_RAD_S, WHEEL_RADIUS_M
from fbql_fusion.core.tasks.soccer.world_model.fitting import (
    can_fit,
    fit,
    fitted_distance,
    fitted_gain_deviation,
    fitted_gap,
    least_squares,
    mirrored,
    with_mirror_image,
)
from fbql_fusion.core.tasks.soccer.world_model.model import SCRATCH, next_state
from fbql_fusion.core.tasks.soccer.world_model.parameters import FAMILIES, WorldModelParameters
from fbql_fusion.core.tasks.soccer.world_model.real_steps import RealSteps, Transitions
from fbql_sim.core.parameters import SimulationParameters
from fbql_sim.core.scripted_law import law
from fbql_sim.core.world_loop import WorldLoop

FEW = WorldModelParameters(model_trees=2, model_leaf_steps=20, model_bins=20)


def played(seeds: range, max_steps: int = 300) -> RealSteps:
    """Episodes of the scripted law."""
    loop = WorldLoop(SimulationParameters(max_steps=max_steps))
    steps = RealSteps(100_000)
    for seed in seeds:
        world = loop.reset(seed, seed)
        steps.begin(world)
        while not world.ended:
            command = law(world)
            world = loop.step(*command)
            steps.add(*command, world)
    return steps


STEPS = played(range(12))


def test_a_fit_finds_the_simulators_constants() -> None:
    model = fit(STEPS, FEW, np.random.default_rng(1))
    assert model.rolling.keep == pytest.approx(exp(-0.3374 / 60), abs=1e-4)
    assert model.rolling.travel_s == pytest.approx(1 / 60, rel=0.01)
    assert model.wheels.advance == pytest.approx(1 / 60, rel=0.01)
    assert model.wheels.turn == pytest.approx(1 / 60, rel=0.01)
    assert float(np.interp(1.0, model.wheels.errors, model.wheels.changes)) == pytest.approx(0.1, rel=0.05)
    assert len(model.robot_wall.roots) == len(model.ball_robot.roots) == len(model.ball_wall.roots) == 2


def test_the_same_generator_gives_the_same_fit() -> None:
    first, again = (fit(STEPS, FEW, np.random.default_rng(1)) for _ in range(2))
    assert np.array_equal(first.ball_robot.nodes, again.ball_robot.nodes)


@pytest.mark.parametrize("family", FAMILIES)
def test_every_family_predicts_better_than_that_nothing_changes(family: str) -> None:
    model = fit(STEPS, replace(FEW, model_family=family), np.random.default_rng(1))
    real = played(range(10, 12), 200).transitions()
    rng, scratch = np.random.default_rng(2), np.zeros(SCRATCH)
    found = np.array(
        [
            next_state(model, tuple(state), *(WHEEL_RADIUS_M * command), scratch, rng)[0]
            for state, command in zip(real.before, np.clip(real.commands, -88.0, 88.0), strict=True)
        ]
    )
    places, speeds = [0, 1, 5, 6], [3, 7, 8]
    for columns in (places, speeds):
        missed = ((found[:, columns] - real.after[:, columns]) ** 2).mean()
        assert missed < ((real.before[:, columns] - real.after[:, columns]) ** 2).mean()


REMEMBERING = replace(FEW, model_trees=1, model_leaf_steps=1, model_mirror=False, model_known_sizes=False)


@pytest.mark.parametrize(
    "parameters",
    [
        replace(REMEMBERING, model_robot_wall_m=10.0, model_ball_robot_m=0.6, model_ball_wall_m=10.0),
        replace(REMEMBERING, model_family="forest"),
        replace(REMEMBERING, model_family="neighbours", model_neighbours=1),
    ],
)
def test_a_model_that_averages_nothing_predicts_every_step_that_it_was_fitted_to(
    parameters: WorldModelParameters,
) -> None:
    """So what a fit tells of a step is what a prediction is told. All steps are near a wall for these distances."""
    steps = played(range(3), 80)
    real = steps.transitions()
    model = fit(steps, parameters, np.random.default_rng(1))
    scratch, rng = np.zeros(SCRATCH), np.random.default_rng(2)
    commands = WHEEL_RADIUS_M * np.clip(real.commands, -MAX_WHEEL_RAD_S, MAX_WHEEL_RAD_S)
    for before, command, after, touched in zip(real.before, commands, real.after, real.touched, strict=True):
        found = next_state(model, tuple(before.tolist()), *command.tolist(), scratch, rng)
        assert found[1] == bool(touched)
        missed = np.array(found[0]) - after
        missed[2] = remainder(missed[2], tau)
        assert missed == pytest.approx(np.zeros(9), abs=1e-9)


def test_a_command_beyond_full_speed_is_seen_as_full_speed() -> None:
    fitted = []
    for most in (MAX_WHEEL_RAD_S, 1000.0):
        steps, rng = RealSteps(1000), np.random.default_rng(4)
        loop = WorldLoop(SimulationParameters(max_steps=120))
        world = loop.reset(0, 0)
        steps.begin(world)
        while not world.ended:
            left, right = (most if fast else 10.0 for fast in rng.random(2) < 0.5)
            world = loop.step(left, -right)
            steps.add(left, -right, world)
        fitted.append(fit(steps, FEW, np.random.default_rng(1)))
    assert fitted[0].wheels.errors.tobytes() == fitted[1].wheels.errors.tobytes()


def test_without_the_mirror_image_there_is_half_as_much_to_fit() -> None:
    sizes = [
        len(fit(STEPS, replace(FEW, model_mirror=mirror), np.random.default_rng(1)).ball_robot.outputs)
        for mirror in (True, False)
    ]
    assert sizes[0] > 1.4 * sizes[1]


def test_the_mirror_image_of_a_mirror_image_is_the_original() -> None:
    real = STEPS.transitions()
    assert np.array_equal(mirrored(mirrored(real.before)), real.before)
    both = with_mirror_image(real)
    n = len(real.before)
    assert np.array_equal(both.commands[n:], both.commands[:n, ::-1])
    assert np.array_equal(both.before[n:, 6], -both.before[:n, 6])
    assert np.array_equal(both.before[n:, 3], both.before[:n, 3])


def test_fitted_distances_are_near_those_at_which_bodies_can_touch() -> None:
    fitted = replace(FEW, model_robot_wall_m=-1.0, model_ball_robot_m=-1.0, model_ball_wall_m=-1.0)
    model = fit(STEPS, fitted, np.random.default_rng(1))
    assert 0.04 < model.robot_wall_m < 0.12
    assert 0.05 < model.ball_robot_m < 0.15
    assert 0.02 < model.ball_wall_m < 0.12


def test_a_distance_is_fitted_by_what_a_free_body_does_not_do() -> None:
    distance = np.linspace(0.0, 1.0, 1001)
    assert fitted_distance(distance, np.where(distance < 0.2, 1.0, 0.01)) == pytest.approx(0.2, abs=0.01)
    assert fitted_distance(distance, np.full(1001, 0.01)) == 0.0


@pytest.mark.parametrize(("error", "expected"), [(3.0, 0.0), (3.1, 0.2)])
def test_a_body_is_free_up_to_three_times_the_error_far_away(error: float, expected: float) -> None:
    distance = np.linspace(0.0, 1.0, 1001)
    assert fitted_distance(distance, np.where(distance < 0.2, error, 1.0)) == pytest.approx(expected, abs=0.01)


@pytest.mark.parametrize(("odd", "expected"), [(1, 0.5), (6, 0.0)])
def test_one_large_error_of_a_thousand_far_away_does_not_count_and_with_six_such_errors_are_usual(
    odd: int, expected: float
) -> None:
    distance = np.linspace(0.0, 1.0, 2001)
    missed = np.where(distance < 0.5, 9.0, 1.0)
    missed[(distance > 0.9) & (distance <= 0.9 + odd / 2000)] = 9.0
    assert fitted_distance(distance, missed) == pytest.approx(expected, abs=0.01)


def test_where_everything_is_equally_near_no_distance_is_fitted() -> None:
    assert fitted_distance(np.full(5, 0.3), np.arange(5.0)) == 0.0


def marks(touched: list[int], collides: list[int], episode: list[int]) -> Transitions:
    n = len(touched)
    nothing = np.zeros((n, 9))
    marked = np.array(touched, dtype=np.float64), np.array(collides, dtype=np.bool_)
    return Transitions(nothing, np.zeros((n, 2)), nothing, *marked, np.array(episode))


def test_the_gap_is_the_shortest_after_which_a_collision_began_again() -> None:
    assert fitted_gap(marks([1, 0, 1, 0, 0, 0, 1], [1, 0, 0, 0, 0, 0, 1], [0] * 7)) == 3
    assert fitted_gap(marks([1, 0, 0, 1], [1, 0, 0, 1], [0, 0, 1, 1])) == 1  # of another episode
    assert fitted_gap(marks([0, 0], [0, 0], [0, 0])) == 1


def test_the_gain_deviation_is_that_of_the_simulated_wheels() -> None:
    loop = WorldLoop(SimulationParameters(max_steps=60, wheel_gain_deviation=0.05))
    steps = RealSteps(100_000)
    for seed in range(40):
        world = loop.reset(seed, seed)
        steps.begin(world)
        while not world.ended:
            world = loop.step(40.0, 40.0)
            steps.add(40.0, 40.0, world)
    assert fitted_gain_deviation(steps.transitions()) == pytest.approx(0.05, rel=0.35)
    model = fit(steps, replace(FEW, model_gain_deviation=-1.0), np.random.default_rng(1))
    assert model.gain_deviation == pytest.approx(0.05, rel=0.35)


def settled(ratios: list[float], steps: int, commanded: float = 20.0, error_m_s: float = 0.0) -> Transitions:
    """Episodes in which both wheels reach these shares of the command, and lack a little of it before each step."""
    speed = np.repeat(ratios, steps) * commanded * WHEEL_RADIUS_M
    before, after = np.zeros((2, len(speed), 9))
    before[:, 3], after[:, 3] = commanded * WHEEL_RADIUS_M - error_m_s, speed
    nothing = np.zeros(len(speed))
    episodes = np.repeat(np.arange(len(ratios)), steps)
    return Transitions(before, np.full((len(speed), 2), commanded), after, nothing, nothing > 0.0, episodes)


def test_the_gain_deviation_is_the_spread_of_the_settled_wheels_of_episodes_that_are_long_enough() -> None:
    ratios = [0.9, 1.0, 1.1]
    spread = pytest.approx(np.std(ratios))
    assert fitted_gain_deviation(settled(ratios, 30)) == spread
    assert fitted_gain_deviation(settled(ratios, 29)) == 0.0
    assert fitted_gain_deviation(settled(ratios, 30, -20.0)) == spread
    assert fitted_gain_deviation(settled([1.0], 30)) == 0.0
    for error_m_s, expected in ((0.07, spread), (-0.07, spread), (0.09, 0.0), (-0.09, 0.0)):
        assert fitted_gain_deviation(settled(ratios, 30, error_m_s=error_m_s)) == expected
    for speed_m_s, expected in ((0.31, spread), (0.29, 0.0)):
        assert fitted_gain_deviation(settled(ratios, 30, speed_m_s / WHEEL_RADIUS_M)) == expected


@pytest.mark.parametrize(("steps", "enough"), [(99, False), (100, True)])
def test_a_hundred_steps_can_be_fitted_and_fewer_can_not(steps: int, enough: bool) -> None:
    assert can_fit(played(range(1), max_steps=steps)) == enough


def test_too_few_steps_can_not_be_fitted() -> None:
    assert can_fit(STEPS)
    assert not can_fit(RealSteps(100))


def test_a_forest_of_the_whole_state_predicts_however_few_the_steps_are() -> None:
    parameters = replace(FEW, model_family="forest", model_leaf_steps=1000)
    steps = played(range(1), max_steps=150)
    rng = np.random.default_rng(1)
    model = fit(steps, parameters, rng)
    assert len(model.whole.roots) == 2
    state = tuple(steps.starts()[0].tolist())
    after, _ = next_state(model, state, 0.0, 0.0, np.zeros(SCRATCH), rng)
    assert np.isfinite(after).all()


def test_least_squares_are_those_of_numpy() -> None:
    rng = np.random.default_rng(1)
    x = rng.normal(size=(300, 5)) * np.array([1.0, 10.0, 0.1, 2.0, 1.0])
    y = rng.normal(size=(300, 2))
    assert least_squares(x, y) == pytest.approx(np.linalg.lstsq(x, y, rcond=None)[0], rel=1e-5)


def test_an_input_that_never_differs_gets_a_finite_weight() -> None:
    x = np.column_stack([np.zeros(50), np.ones(50), np.arange(50.0)])
    weights = least_squares(x, 3.0 + 2.0 * np.arange(50.0)[:, None])
    assert weights[:, 0] == pytest.approx([0.0, 3.0, 2.0], abs=1e-4)
