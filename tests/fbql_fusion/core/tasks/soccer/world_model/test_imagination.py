"""Imagined episodes: what they record, how they end, and the same features as real steps have."""

from __future__ import annotations

from dataclasses import replace
from math import exp, nextafter
from typing import Any

import numpy as np
import pytest
from fbql_behaviors.core.behavior import Behavior
from fbql_behaviors.shipped import shipped_trees
from fbql_behaviors.storage import load_tree
from fbql_common.core.types import World
from fbql_common.core.walls import HALF_GOAL, closest_wall_point
from fbql_fusion.core.learners.features import Features, KeyIndex, Resolution, Scales, Situation
from fbql_fusion.core.learners.tilings import critic_tilings
from fbql_fusion.core.tasks.soccer.critic import WIDTHS, critic_inputs
from fbql_fusion.core.tasks.soccer.world_model import imagination
from fbql_fusion.core.tasks.soccer.world_model.ball import Rolling
from fbql_fusion.core.tasks.soccer.world_model.forest import Forest
from fbql_fusion.core.tasks.soccer.world_model.imagination import (
    GOAL,
    GOAL_X_M,
    OWN_GOAL,
    TIMEOUT,
    Imagined,
    ImaginedWorld,
    Rewards,
    Rules,
    draw_driver,
    imagined_starts,
    play_episodes,
    within_numbers,
)
from fbql_fusion.core.tasks.soccer.world_model.model import EMPTY, State, WorldModel, next_state
from fbql_fusion.core.tasks.soccer.world_model.parameters import WorldModelParameters
from fbql_fusion.core.tasks.soccer.world_model.real_steps import RealSteps
from fbql_fusion.core.tasks.soccer.world_model.robot import Wheels
from fbql_fusion.core.tasks.soccer.world_model.team import SENSES, Team, TreeParts
from numpy.typing import NDArray

BEHAVIORS = {name: Behavior(name, load_tree(shipped_trees() / f"{name}.json")) for name in SENSES}
TEAM = Team([TreeParts(b.tree.nodes, b.tree.leaves, b.tree.hash) for b in BEHAVIORS.values()], list(BEHAVIORS))
SAME_PLACE = WorldModelParameters(
    imagined_observed_starts=1.0, imagined_start_jitter_m=0.0, imagined_max_steps=30, model_mirror=False
)
DT = 1 / 60
MODEL = EMPTY._replace(
    wheels=Wheels(np.array([-0.1, 0.1]), np.array([-0.1, 0.1]), DT, 0.0, DT), rolling=Rolling(1.0, DT), gap_steps=3
)
REWARDS = Rewards(10.0, -7.0, -0.5)


def world_of(robot: tuple[float, float, float], ball: tuple[float, float], ball_vx: float = 0.0) -> World:
    return World(1, 0, 0, *robot, 0.0, 0.0, *ball, ball_vx, 0.0, *closest_wall_point(*robot[:2]), *[False] * 6)


def situation_of(world: World) -> Situation:
    outputs = [behavior.answer(world) for behavior in BEHAVIORS.values()]
    leaves = tuple(output.leaf_id for output in outputs)
    return Situation(leaves, tuple(output.observation for output in outputs), critic_inputs(world, mirror=True))


def some_features(critic: int = 4, leaf_pairs: bool = True) -> Features:
    rng = np.random.default_rng(1)
    places = rng.uniform(-0.8, 0.8, (60, 5)).tolist()
    seen = [situation_of(world_of((x, y, 3 * yaw), (bx, by))) for x, y, yaw, bx, by in places]
    resolution = Resolution(leaf_pairs=leaf_pairs, world_tilings=critic)
    scales = Scales.of(seen, mirror=True)
    offsets = Features.random_offsets(resolution, len(scales.knots), rng)
    return Features(scales, resolution, offsets, critic_tilings(WIDTHS, critic))


def steps_from(world: World) -> RealSteps:
    """One real step from a world."""
    steps = RealSteps(100)
    steps.begin(world)
    steps.add(0.0, 0.0, world._replace(truncated=True))
    return steps


def played(
    world: World,
    model: WorldModel = MODEL,
    features: Features | None = None,
    theta: NDArray[np.float64] | None = None,
    episodes: int = 1,
    hold: int = 4,
    discount: float = 0.9,
    parameters: WorldModelParameters = SAME_PLACE,
) -> Imagined:
    features = some_features() if features is None else features
    imagined = ImaginedWorld(model, TEAM, features, REWARDS, steps_from(world), parameters)
    return imagined.play(
        np.zeros((0, 3)) if theta is None else theta, episodes, hold, discount, np.random.default_rng(3)
    )


AWAY = world_of((-0.5, 0.125, 0.25), (0.25, -0.375))  # exact as float32


def test_an_episode_without_an_end_is_truncated_and_every_decision_is_held() -> None:
    imagined = played(AWAY)
    assert (imagined.outcomes.tolist(), imagined.terminated.tolist(), imagined.steps.tolist()) == (
        [TIMEOUT],
        [False],
        [30],
    )
    assert imagined.lengths.tolist() == [8]  # the last one for 2 steps
    assert imagined.discounts == pytest.approx([0.9**4] * 7 + [0.9**2])
    assert imagined.rewards.tolist() == [0.0] * 8
    assert imagined.old_probs == pytest.approx([1 / 3] * 8)
    assert set(imagined.drivers.tolist()) == {0, 1, 2}


def test_an_imagined_episode_begins_in_the_state_of_a_real_one(monkeypatch: pytest.MonkeyPatch) -> None:
    met: list[State] = []

    def seen(model: WorldModel, state: State, *rest: Any) -> tuple[State, bool]:
        met.append(state)
        return next_state(model, state, *rest)

    monkeypatch.setattr(imagination, "next_state", seen)
    monkeypatch.setattr(imagination.play_episodes, "run", imagination.play_episodes.interpreted)
    moving = AWAY._replace(robot_speed_m_s=0.5, robot_yaw_rate_rad_s=0.75, ball_vx_m_s=0.375, ball_vy_m_s=0.625)
    played(moving)
    assert met[0] == (-0.5, 0.125, 0.25, 0.5, 0.75, 0.25, -0.375, 0.375, 0.625)


@pytest.mark.parametrize(("vx", "outcome", "reward"), [(1.2, GOAL, 10.0), (-1.2, OWN_GOAL, -7.0)])
def test_a_ball_behind_a_goal_line_ends_the_episode_with_its_reward(vx: float, outcome: int, reward: float) -> None:
    side = 1.0 if vx > 0.0 else -1.0
    imagined = played(world_of((0.0, 0.5, 0.0), (side * 1.0, 0.05), vx))
    assert (imagined.outcomes.tolist(), imagined.terminated.tolist()) == ([outcome], [True])
    assert imagined.steps.tolist() == [7]  # the ball needs 6.07 steps
    assert imagined.rewards == pytest.approx([0.0, 0.9**2 * reward])
    assert imagined.discounts == pytest.approx([0.9**4, 0.9**3])


def test_a_collision_counts_when_it_begins_and_again_only_after_the_gap() -> None:
    leaf = np.array([[-1.0, 0.0, 0.0]])
    touching = Forest(np.zeros(1, dtype=np.int64), leaf, np.array([[0.0, 0.0, 0.0, 0.0, 0.0, 1.0]]))
    near = MODEL._replace(robot_wall_m=9.0, robot_wall=touching)
    imagined = played(AWAY, near)
    assert imagined.collisions.tolist() == [1]
    assert imagined.rewards == pytest.approx([-0.5] + [0.0] * 7)
    touching.outputs[0, 5] = 0.5
    long = replace(SAME_PLACE, imagined_max_steps=500)
    for gap in (1, 2, 3):
        imagined = played(AWAY, near._replace(gap_steps=gap), episodes=5, parameters=long)
        # a contact, and before it as many steps without one
        assert imagined.collisions.sum() / imagined.steps.sum() == pytest.approx(0.5 * 0.5**gap, rel=0.2)


def test_the_features_are_those_of_a_real_situation() -> None:
    for features in (some_features(), some_features(critic=0), some_features(leaf_pairs=False)):
        rows = played(AWAY, features=features).rows
        before = len(features)
        assert rows[0].tolist() == features.row(situation_of(AWAY))
        assert len(features) == before
        assert rows.shape == (9, features.active_features + features.critic_features)


def test_features_met_before_keep_their_indices_and_new_ones_get_the_next() -> None:
    features = some_features()
    own = features.row(situation_of(AWAY))
    known = len(features)
    imagined = played(AWAY, features=features)
    assert imagined.rows[0].tolist() == own
    assert len(features) > known
    assert imagined.rows.max() == len(features) - 1
    assert len(set(features.keys.tolist())) == len(features)


def test_many_features_are_all_found_again() -> None:
    features = some_features()
    long = replace(SAME_PLACE, imagined_max_steps=400, imagined_start_jitter_m=0.5)
    first = played(AWAY, features=features, episodes=6, parameters=long)
    again = played(AWAY, features=features, episodes=6, parameters=long)
    assert len(features) > 2000
    assert np.array_equal(first.rows, again.rows)


def test_the_policy_decides_who_drives() -> None:
    features = some_features()
    theta = np.zeros((5000, 3))
    theta[:, 2] = 5.0
    imagined = played(AWAY, features=features, theta=theta, episodes=3)
    assert set(imagined.drivers.tolist()) == {2}
    assert imagined.old_probs == pytest.approx([1.0] * len(imagined.drivers))


def test_a_driver_is_drawn_by_the_weights_and_features_beyond_the_table_count_nothing() -> None:
    theta = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    weights = np.zeros(3)
    rng = np.random.default_rng(1)
    drawn = [draw_driver(theta, np.array([0, 7, 1, 9]), 2, weights, rng) for _ in range(3000)]
    total = 2.0 + exp(1.0)
    assert weights == pytest.approx([1 / total, exp(1.0) / total, 1 / total])
    assert np.bincount(drawn) / 3000 == pytest.approx(weights, abs=0.03)


def test_the_driver_follows_its_own_tree_while_it_is_held() -> None:
    theta = np.zeros((5000, 3))
    theta[:, 0] = 50.0
    world = AWAY
    for _ in range(4):  # what ball seeking does in the real loop, with the model's own step
        left, right = BEHAVIORS["ball_seeking"].answer(world).command
        wheels = [world.robot_speed_m_s + side * world.robot_yaw_rate_rad_s * 0.035 for side in (-1, 1)]
        a, b = (w + min(max(0.02 * c - w, -0.1), 0.1) for w, c in zip(wheels, (left, right), strict=True))
        speed, rate = (a + b) / 2, (b - a) / 0.07
        x = world.robot_x_m + DT * speed * np.cos(world.robot_yaw_rad)
        y = world.robot_y_m + DT * speed * np.sin(world.robot_yaw_rad)
        world = world._replace(
            robot_x_m=float(x), robot_y_m=float(y), robot_yaw_rad=world.robot_yaw_rad + DT * rate,
            robot_speed_m_s=speed, robot_yaw_rate_rad_s=rate,
        )  # fmt: skip
    wall_x, wall_y, wall_yaw = closest_wall_point(world.robot_x_m, world.robot_y_m)
    world = world._replace(wall_x_m=wall_x, wall_y_m=wall_y, wall_yaw_rad=wall_yaw)
    features = some_features()
    model = MODEL._replace(gain_deviation=0.0)
    imagined = played(AWAY, model, features, theta, parameters=replace(SAME_PLACE, imagined_max_steps=4))
    assert imagined.rows[-1].tolist() == features.row(situation_of(world))


def test_how_long_a_decision_is_held_changes_nothing_where_one_behavior_drives_alone() -> None:
    theta = np.zeros((50_000, 3))
    theta[:, 0] = 50.0
    ends: list[list[int]] = []
    for hold in (1, 60):
        features = some_features()
        long = replace(SAME_PLACE, imagined_max_steps=60)
        row = played(AWAY, MODEL._replace(gain_deviation=0.0), features, theta, hold=hold, parameters=long).rows[-1]
        ends.append(features.keys[row].tolist())
    assert ends[0] == ends[1]


def test_starts_are_near_observed_ones_or_observed_states() -> None:
    starts = np.tile(np.array([-0.9, 0.0, 0.1, 0.0, 0.0, 0.5, 0.5, 0.0, 0.0]), (3, 1))
    states = np.tile(np.array([0.3, 0.2, 0.1, 0.5, 0.0, -0.5, 0.5, 0.1, 0.0]), (3, 1))
    rng = np.random.default_rng(2)
    parameters = replace(SAME_PLACE, imagined_observed_starts=0.7, imagined_start_jitter_m=0.02)
    found = imagined_starts(starts, states, 1000, parameters, rng)
    near = found[:, 0] < -0.5
    assert near.mean() == pytest.approx(0.7, abs=0.05)
    assert np.abs(found[near] - starts[0]).max() == pytest.approx(0.02, abs=1e-3)
    assert np.array_equal(found[~near], np.tile(states[0], ((~near).sum(), 1)))
    both = imagined_starts(starts, states, 1000, replace(parameters, model_mirror=True), rng)
    assert (both[:, 6] < 0.0).mean() == pytest.approx(0.5, abs=0.05)


def test_only_places_are_jittered_to_both_sides() -> None:
    start = np.array([[-0.9, 0.0, 0.1, 0.2, 0.3, 0.5, 0.5, 0.6, 0.7]])
    parameters = replace(SAME_PLACE, imagined_start_jitter_m=0.02, model_known_sizes=False)
    moved = imagined_starts(start, start, 1000, parameters, np.random.default_rng(2)) - start
    furthest = np.array([0.02, 0.02, 0.0, 0.0, 0.0, 0.02, 0.02, 0.0, 0.0])
    assert moved.max(axis=0) == pytest.approx(furthest, abs=1e-3)
    assert moved.min(axis=0) == pytest.approx(-furthest, abs=1e-3)


def test_the_wheels_of_each_episode_have_gains_of_their_own_around_1(monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[NDArray[np.float64]] = []

    def watched(*arguments: Any) -> Any:
        seen.append(arguments[6])
        return play_episodes(*arguments)

    monkeypatch.setattr(imagination, "play_episodes", watched)
    played(
        AWAY, MODEL._replace(gain_deviation=0.05), episodes=400, parameters=replace(SAME_PLACE, imagined_max_steps=1)
    )
    (gains,) = seen
    assert gains.shape == (400, 2)
    assert gains.mean(axis=0) == pytest.approx([1.0, 1.0], abs=0.01)
    assert gains.std(axis=0) == pytest.approx([0.05, 0.05], rel=0.15)
    assert abs(np.corrcoef(gains.T)[0, 1]) < 0.2


@pytest.mark.parametrize(("left", "right"), [(1.0, 1.1), (0.9, 1.0)])
def test_a_gain_is_that_of_its_own_wheel(left: float, right: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Driven alike, the robot turns away from the wheel that gains more."""
    told: list[tuple[float, ...]] = []

    def watched(model: WorldModel, state: State, *commands: Any) -> Any:
        told.append(commands[:2])
        return next_state(model, state, *commands)

    def with_gains(*arguments: Any) -> Any:
        # interpreted, whatever was compiled before: a compiled kernel would not see the watched one
        return play_episodes.function(*arguments[:6], np.array([[left, right]]), *arguments[7:])

    monkeypatch.setattr(imagination, "next_state", watched)
    monkeypatch.setattr(imagination, "play_episodes", with_gains)
    one = TreeParts([0], [(20.0, 20.0)], "one")
    steps = steps_from(AWAY)
    team = Team([one] * 3, list(SENSES))
    ImaginedWorld(MODEL, team, some_features(critic=0, leaf_pairs=False), REWARDS, steps, SAME_PLACE).play(
        np.zeros((0, 3)), 1, 4, 0.9, np.random.default_rng(3)
    )
    assert told[0] == pytest.approx((0.02 * 20.0 * left, 0.02 * 20.0 * right))


def test_no_start_overlaps_a_wall() -> None:
    starts = np.array([[0.0, 0.86, 0.0, 0.0, 0.0, 0.5, 0.5, 0.0, 0.0]])
    parameters = replace(SAME_PLACE, imagined_start_jitter_m=0.02)
    found = imagined_starts(starts, starts, 100, parameters, np.random.default_rng(1))
    assert found[:, 1].max() <= 0.9 - 0.0375 + 1e-9
    known = replace(parameters, model_known_sizes=False)
    assert imagined_starts(starts, starts, 100, known, np.random.default_rng(1))[:, 1].max() > 0.87


def test_a_bad_model_does_not_lead_out_of_the_numbers() -> None:
    assert within_numbers((9.0, -9.0, 1.0, 99.0, -999.0, -9.0, 9.0, 99.0, -99.0)) == pytest.approx((
        1.2, -0.9, 1.0, 10.0, -100.0, -1.2, 0.9, 10.0, -10.0,
    ))  # fmt: skip
    assert within_numbers((-9.0, 9.0, 1.0, -99.0, 999.0, 9.0, -9.0, -99.0, 99.0)) == pytest.approx((
        -1.2, 0.9, 1.0, -10.0, 100.0, 1.2, -0.9, -10.0, 10.0,
    ))  # fmt: skip


def test_a_ball_beside_the_goal_is_in_no_goal() -> None:
    """Without the known sizes it could be there."""
    free = MODEL._replace(known_sizes=False)
    for y, outcome in ((HALF_GOAL, TIMEOUT), (nextafter(HALF_GOAL, 0.0), GOAL)):
        start = np.array([[0.0, 0.5, 0.0, 0.0, 0.0, GOAL_X_M, y, 0.0, 0.0]])
        features = some_features()
        rules = Rules(REWARDS, 4, 0.9, 3, False)
        found, _ = play_episodes(
            free, TEAM.trees, features.tables(), KeyIndex.of(features.keys), np.zeros((0, 3)), start, np.ones((1, 2)),
            rules, np.random.default_rng(3),
        )  # fmt: skip
        assert found.outcomes.tolist() == [outcome]
