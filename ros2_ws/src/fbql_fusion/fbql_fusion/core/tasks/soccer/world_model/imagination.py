"""Imagined episodes: the policy plays in the world model, and its decisions go into the same update as real ones."""

from __future__ import annotations

from math import exp
from typing import NamedTuple

import numpy as np
from fbql_common.core.field import BALL_RADIUS_M, FIELD, WHEEL_RADIUS_M
from fbql_common.core.kernels import kernel
from fbql_common.core.walls import HALF_GOAL, HALF_WIDTH, POCKET
from numpy.typing import NDArray

from fbql_fusion.core.learners.features import Features, FeatureTables, KeyIndex, indices_of, situation_keys
from fbql_fusion.core.learners.linear import Floats
from fbql_fusion.core.tasks.soccer.critic import CRITIC_INPUTS, critic_numbers
from fbql_fusion.core.tasks.soccer.world_model.fitting import mirrored
from fbql_fusion.core.tasks.soccer.world_model.model import SCRATCH, State, WorldModel, apart, next_state
from fbql_fusion.core.tasks.soccer.world_model.parameters import WorldModelParameters
from fbql_fusion.core.tasks.soccer.world_model.real_steps import RealSteps
from fbql_fusion.core.tasks.soccer.world_model.team import SENSED, Team, Trees, leaf_id_of, sense

GOAL_X_M = FIELD.half_length_m + BALL_RADIUS_M
"""|x| from which the whole ball is past a goal line [m]."""
TIMEOUT, GOAL, OWN_GOAL = range(3)
"""How an imagined episode ended."""
_FASTEST = 10.0
"""No speed of a state exceeds this [m/s], and no turn rate ten times this [rad/s], so that a bad model cannot diverge."""


class Rewards(NamedTuple):
    """The rewards of an episode."""

    goal: float
    own_goal: float
    collision: float
    """Once when it begins."""


class Rules(NamedTuple):
    """How an imagined episode is played."""

    rewards: Rewards
    hold_steps: int
    discount: float
    """gamma, per step."""
    max_steps: int
    mirror: bool
    """Whether mirrored situations share the tiles of the critic's inputs."""


class Imagined(NamedTuple):
    """E episodes with N decisions in all."""

    lengths: NDArray[np.int64]
    """Decisions of each, [E]."""
    terminated: NDArray[np.bool_]
    """[E]"""
    rows: NDArray[np.int64]
    """Features of each episode's decisions and of the situation it ended in, [N + E, F + F']."""
    drivers: NDArray[np.int64]
    """[N]"""
    old_probs: Floats
    """[N]"""
    rewards: Floats
    """R of each decision, [N]."""
    discounts: Floats
    """gamma^k of each decision, [N]."""
    outcomes: NDArray[np.int64]
    """TIMEOUT, GOAL or OWN_GOAL, [E]."""
    steps: NDArray[np.int64]
    """[E]"""
    collisions: NDArray[np.int64]
    """Collisions that began, [E]."""


@kernel
def draw_driver(
    theta: Floats, row: NDArray[np.int64], active: int, weights: Floats, generator: np.random.Generator
) -> int:
    """Draws a behavior by the weights of eq. 10, which are written to `weights`, [n].

    Args:
        theta: [features, n]; features beyond it count 0.
        row: features of the situation, of which the first `active` are the weights'.
    """
    n = len(weights)
    weights[:] = 0.0
    for f in range(active):
        feature = row[f]
        if feature < len(theta):
            for i in range(n):
                weights[i] += theta[feature, i]
    highest = weights[0]
    for i in range(1, n):
        highest = max(highest, weights[i])
    total = 0.0
    for i in range(n):
        weights[i] = exp(weights[i] - highest)
        total += weights[i]
    for i in range(n):
        weights[i] /= total
    left = generator.random()
    for i in range(n):
        left -= weights[i]
        if left < 0.0:
            return i
    return int(np.argmax(weights))


@kernel
def within_numbers(state: State) -> State:
    """The state, moved into the field's bounds and limited to possible speeds."""
    robot_x, robot_y, yaw, speed, rate, ball_x, ball_y, vx, vy = state
    return (
        min(max(robot_x, -POCKET), POCKET),
        min(max(robot_y, -HALF_WIDTH), HALF_WIDTH),
        yaw,
        min(max(speed, -_FASTEST), _FASTEST),
        min(max(rate, -10.0 * _FASTEST), 10.0 * _FASTEST),
        min(max(ball_x, -POCKET), POCKET),
        min(max(ball_y, -HALF_WIDTH), HALF_WIDTH),
        min(max(vx, -_FASTEST), _FASTEST),
        min(max(vy, -_FASTEST), _FASTEST),
    )


@kernel
def play_episodes(
    model: WorldModel,
    trees: Trees,
    features: FeatureTables,
    index: KeyIndex,
    theta: Floats,
    starts: Floats,
    gains: Floats,
    rules: Rules,
    generator: np.random.Generator,
) -> tuple[Imagined, KeyIndex]:
    """Plays an episode from each start.

    Args:
        index: of the features met before.
        theta: the policy, [features, n].
        starts: states, [E, 9].
        gains: of the left and the right wheel, [E, 2].
        generator: of all draws.

    Returns:
        What was played, and the index with the features that were met for the first time.
    """
    episodes, n = len(starts), len(trees.roots)
    width = features.active + features.critic
    most = episodes * ((rules.max_steps + rules.hold_steps - 1) // rules.hold_steps)
    rows = np.empty((most + episodes, width), dtype=np.int64)
    drivers = np.empty(most, dtype=np.int64)
    old_probs, returns, discounts = np.empty(most), np.empty(most), np.empty(most)
    lengths = np.zeros(episodes, dtype=np.int64)
    terminated = np.zeros(episodes, dtype=np.bool_)
    outcomes = np.zeros(episodes, dtype=np.int64)
    steps = np.zeros(episodes, dtype=np.int64)
    collisions = np.zeros(episodes, dtype=np.int64)
    scratch, weights = np.zeros(SCRATCH), np.zeros(n)
    values = np.zeros(n * SENSED + (CRITIC_INPUTS if features.critic > 0 else 0))
    leaves = np.zeros(n, dtype=np.int64)
    at = -1  # the decision in progress
    for episode in range(episodes):
        own = starts[episode]
        state = (own[0], own[1], own[2], own[3], own[4], own[5], own[6], own[7], own[8])
        left_gain, right_gain = WHEEL_RADIUS_M * gains[episode, 0], WHEEL_RADIUS_M * gains[episode, 1]
        held_for, driver, first = 0, 0, at + 1
        since_contact = model.gap_steps
        step = 0
        outcome = TIMEOUT
        while step < rules.max_steps and outcome == TIMEOUT:
            if held_for == 0:
                held_for = rules.hold_steps
                at += 1
                row = rows[at + episode]
                index = _features_into(row, state, trees, features, index, rules.mirror, values, leaves)
                driver = draw_driver(theta, row, features.active, weights, generator)
                drivers[at], old_probs[at], returns[at], discounts[at] = driver, weights[driver], 0.0, 1.0
            else:
                sense(trees.senses[driver], state, values, driver * SENSED)
                leaves[driver] = leaf_id_of(trees, driver, values)
            held_for -= 1
            reference = trees.references[trees.first_leaves[driver] + leaves[driver]]
            state, touched = next_state(
                model, state, left_gain * reference[0], right_gain * reference[1], scratch, generator
            )
            state = within_numbers(state)
            step += 1
            begins = touched and since_contact >= model.gap_steps
            since_contact = 0 if touched else since_contact + 1
            collisions[episode] += begins
            reward = rules.rewards.collision if begins else 0.0
            if abs(state[5]) >= GOAL_X_M and abs(state[6]) < HALF_GOAL:
                outcome = GOAL if state[5] > 0.0 else OWN_GOAL
                reward += rules.rewards.goal if outcome == GOAL else rules.rewards.own_goal
            returns[at] += discounts[at] * reward
            discounts[at] *= rules.discount
        index = _features_into(rows[at + 1 + episode], state, trees, features, index, rules.mirror, values, leaves)
        lengths[episode], steps[episode], outcomes[episode] = at + 1 - first, step, outcome
        terminated[episode] = outcome != TIMEOUT
    decisions = at + 1
    imagined = Imagined(
        lengths,
        terminated,
        rows[: decisions + episodes].copy(),
        drivers[:decisions].copy(),
        old_probs[:decisions].copy(),
        returns[:decisions].copy(),
        discounts[:decisions].copy(),
        outcomes,
        steps,
        collisions,
    )
    return imagined, index


@kernel
def _features_into(
    row: NDArray[np.int64],
    state: State,
    trees: Trees,
    features: FeatureTables,
    index: KeyIndex,
    mirror: bool,
    values: Floats,
    leaves: NDArray[np.int64],
) -> KeyIndex:
    """Writes the features of a state to `row`, what is sensed to `values` and the leaves to `leaves`."""
    n = len(leaves)
    for i in range(n):
        sense(trees.senses[i], state, values, i * SENSED)
        leaves[i] = leaf_id_of(trees, i, values)
    if features.critic > 0:
        told = critic_numbers(state[5], state[6], state[0], state[1], state[7], state[8], mirror)
        for i in range(CRITIC_INPUTS):
            values[n * SENSED + i] = told[i]
    return indices_of(situation_keys(features, leaves, values), index, row)


class ImaginedWorld:
    """A world model in which the behaviors play.

    Args:
        model: fitted to `steps`.
        team: the behaviors.
        features: of the policy; those that are met for the first time are added.
        rewards: of an episode.
        steps: where episodes begin: at least one whole episode.
        parameters: of the imagination.
    """

    def __init__(
        self,
        model: WorldModel,
        team: Team,
        features: Features,
        rewards: Rewards,
        steps: RealSteps,
        parameters: WorldModelParameters,
    ) -> None:
        self._model = model
        self._team = team
        self._features = features
        self._rewards = rewards
        self._parameters = parameters
        self._tables = features.tables()
        self._index = KeyIndex.of(features.keys)
        self._starts = steps.starts()
        self._states = steps.transitions().before

    def play(
        self, theta: Floats, episodes: int, hold_steps: int, discount: float, generator: np.random.Generator
    ) -> Imagined:
        """Plays episodes with the policy `theta`, drawing every driver.

        Args:
            theta: [features, n]; features beyond it count 0.
            hold_steps: steps for which a decision is held.
            discount: gamma, per step.
            generator: of all draws.
        """
        p = self._parameters
        starts = imagined_starts(self._starts, self._states, episodes, p, generator)
        gains = 1.0 + self._model.gain_deviation * generator.standard_normal((episodes, 2))
        mirror = self._features.resolution.mirror
        rules = Rules(self._rewards, hold_steps, discount, p.imagined_max_steps, mirror)
        known = self._index.known
        imagined, self._index = play_episodes(
            self._model, self._team.trees, self._tables, self._index, theta, starts, gains, rules, generator
        )
        self._features.add_keys(self._index.keys[known : self._index.known])
        return imagined


def imagined_starts(
    starts: Floats, states: Floats, episodes: int, parameters: WorldModelParameters, generator: np.random.Generator
) -> Floats:
    """Eq. 28: where imagined episodes begin: near an observed start, or in any observed state; mirrored by a coin.

    Args:
        starts: observed ones, [S, 9].
        states: observed states that did not end an episode, [N, 9].

    Returns:
        [episodes, 9]
    """
    near = generator.random(episodes) < parameters.imagined_observed_starts
    begun = starts[generator.integers(len(starts), size=episodes)]
    jitter = parameters.imagined_start_jitter_m
    begun[:, [0, 1, 5, 6]] += generator.uniform(-jitter, jitter, size=(episodes, 4))
    found = np.where(near[:, None], begun, states[generator.integers(len(states), size=episodes)])
    if parameters.model_mirror:
        found = np.where(generator.random((episodes, 1)) < 0.5, mirrored(found), found)
    if parameters.model_known_sizes:
        found = np.array([apart(tuple(state)) for state in found.tolist()])
    return found
