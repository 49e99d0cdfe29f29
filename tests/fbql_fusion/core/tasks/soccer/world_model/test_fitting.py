"""The fit, to real steps of the simulator and to made-up ones whose law is known."""

from __future__ import annotations

from dataclasses import replace
from math import exp

import numpy as np
import pytest
from fbql_common.core.field import WHEEL_RADIUS_M
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
