"""DT-based Q-learning (section II.A: "the outputs are adjusted slightly at each leaf node").

The states are the leaves of a tree, the actions small integer changes of a leaf's two wheel levels. A decision is made when
the observation enters another leaf, and holds until the next one: Q-learning on a semi-Markov decision process (Bradtke
and Duff 1995).

    Q(c, a) <- Q(c, a) + alpha [R + gamma^k max_b Q(c', b) - Q(c, a)],   R = sum_{j<k} gamma^j r_j

k is the number of steps from the decision in leaf c to the first decision, in leaf c', that is at least `credit_steps`
later. With credit_steps = 1 that is the next decision. A robot stays in a leaf for about three steps, but its wheels take
longer to follow, so the effect of a change shows in the leaves after it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from itertools import product
from typing import NamedTuple

import numpy as np
from fbql_common.core.errors import BadInput
from fbql_common.core.field import MAX_WHEEL_RAD_S
from fbql_common.core.parameters import check, parameter
from fbql_common.core.types import NO_LEAF, World

from fbql_behaviors.core.exercises import Command, Environment, Exercise
from fbql_behaviors.core.observation import observation_of
from fbql_behaviors.core.quantizer import rad_s_of
from fbql_behaviors.core.tree import Leaf, Tree

Change = tuple[int, int]
"""An action: levels added to the left and the right wheel."""


@dataclass(frozen=True)
class TuningParameters:
    """How the leaves of a tree are tuned."""

    episodes: int = parameter(4000, "episodes that are driven", low=1, high=10_000_000)
    max_change: int = parameter(1, "largest change of a leaf's level", unit="levels", low=1, high=5)
    discount: float = parameter(1.0, "gamma, per step", low=0.0, high=1.0)
    credit_steps: int = parameter(40, "fewest steps after a decision by which it is judged", low=1)
    hold_steps: int = parameter(60, "steps after which a new decision is made if the leaf was not left", low=1)
    learning_rate: float = parameter(0.003, "lowest alpha; until then it is 1 / updates", low=0.0, high=1.0)
    epsilon_start: float = parameter(0.2, "share of random decisions in the first episode", low=0.0, high=1.0)
    epsilon_end: float = parameter(0.05, "share of random decisions in the last episode", low=0.0, high=1.0)
    min_updates: int = parameter(20, "fewest tries after which a change is made", low=0)


TUNINGS = {"wall_avoiding": TuningParameters(episodes=400, discount=0.99)}
"""Settings of behaviors that need their own: an exercise without an end has long episodes, and needs a discount."""


def tuning_of(behavior: str) -> TuningParameters:
    """The setting of a behavior, or the default one if it has none."""
    return TUNINGS.get(behavior, TuningParameters())


class Tuned(NamedTuple):
    """A tuned tree, and what was learned on the way."""

    tree: Tree
    leaves_changed: int
    q: tuple[tuple[float, ...], ...]
    """Q of every leaf and action [leaf_id][action], in the order of `changes_up_to`."""
    updates: tuple[tuple[int, ...], ...]
    """Number of updates of each Q."""
    steps: int
    """Steps driven."""


def changes_up_to(max_change: int) -> tuple[Change, ...]:
    """The actions; no change comes first, so that it wins ties."""
    levels = range(-max_change, max_change + 1)
    return tuple(sorted(product(levels, levels), key=lambda change: (abs(change[0]) + abs(change[1]), change)))


def changed(leaf: Leaf, change: Change) -> Leaf:
    """A leaf with its levels changed, clipped to full wheel velocity."""
    left, right = (
        min(max(wheel_rad_s + rad_s_of(levels), -MAX_WHEEL_RAD_S), MAX_WHEEL_RAD_S)
        for wheel_rad_s, levels in zip(leaf[:2], change, strict=True)
    )
    return Leaf(left, right, leaf.patterns)


def discounted_return(rewards: Sequence[float], discount: float) -> float:
    """R = sum_j gamma^j r_j, j from 0."""
    total = 0.0
    for reward in reversed(rewards):
        total = reward + discount * total
    return total


def smdp_target(rewards: Sequence[float], discount: float, next_value: float) -> float:
    """R + gamma^k V(c'), k being the number of rewards.

    Args:
        next_value: max_b Q(c', b); 0 where the episode terminated. Where it was truncated, the value of the leaf it
            was in.
    """
    return discounted_return(rewards, discount) + discount ** len(rewards) * next_value


def updated_q(q: float, target: float, learning_rate: float) -> float:
    """Q + alpha [target - Q]."""
    return q + learning_rate * (target - q)


def step_size(learning_rate: float, updates: int) -> float:
    """alpha of update number `updates`, counted from 1: 1 / updates (the plain mean), but at least `learning_rate`."""
    return max(learning_rate, 1.0 / updates)


def epsilon_of(parameters: TuningParameters, episode: int) -> float:
    """Share of random decisions in an episode: linear from the first to the last one."""
    progress = episode / max(parameters.episodes - 1, 1)
    return parameters.epsilon_start + (parameters.epsilon_end - parameters.epsilon_start) * progress


def greedy(q: Sequence[float]) -> int:
    """The action of largest Q; ties go to the first, which is nearest to no change."""
    return max(range(len(q)), key=q.__getitem__)


def chosen_changes(
    q: Sequence[Sequence[float]], updates: Sequence[Sequence[int]], changes: Sequence[Change], min_updates: int
) -> tuple[Change, ...]:
    """The change of every leaf: the one of largest Q among no change and those tried at least `min_updates` times."""
    chosen: list[Change] = []
    for values, counts in zip(q, updates, strict=True):
        tried = [action for action, count in enumerate(counts) if action == 0 or count >= min_updates]
        chosen.append(changes[tried[greedy([values[action] for action in tried])]])
    return tuple(chosen)


def tune(
    tree: Tree,
    exercise: Exercise,
    environment: Environment,
    dt_s: float,
    parameters: TuningParameters,
    seed: int,
    progress: Callable[[int], None] = lambda _: None,
) -> Tuned:
    """Tunes the leaves of a tree by practice.

    The tuned tree is a new tree, whose origin records the parameters, the seed and the hash of the tree it came from.

    Args:
        dt_s: duration of a step of the environment [s].
        progress: called after every episode with the number driven so far.

    Raises:
        BadInput: a parameter out of range, or a behavior without an observation.
    """
    check(parameters, "leaf tuning")
    if seed < 0:
        raise BadInput(f"leaf tuning: seed is {seed}; it must be at least 0")
    practice = _Practice(tree, exercise, environment, dt_s, parameters, np.random.default_rng(seed))
    for episode in range(parameters.episodes):
        practice.drive(epsilon_of(parameters, episode))
        progress(episode + 1)
    changes = chosen_changes(practice.q, practice.updates, practice.changes, parameters.min_updates)
    leaves = tuple(changed(leaf, change) for leaf, change in zip(tree.wheel_leaves, changes, strict=True))
    origin = {
        "method": "leaf_tuning",
        "tuned_from": tree.hash,
        "seed": seed,
        **asdict(parameters),
        "tuned_from_origin": dict(tree.origin),
    }
    return Tuned(
        Tree(tree.behavior, tree.features, tree.nodes, leaves, origin),
        sum(new != old for new, old in zip(leaves, tree.leaves, strict=True)),
        tuple(map(tuple, practice.q)),
        tuple(map(tuple, practice.updates)),
        practice.steps,
    )


class _Decision(NamedTuple):
    leaf_id: int
    action: int
    step: int


class _Practice:
    """Q, and the episodes in which it is learned."""

    def __init__(
        self,
        tree: Tree,
        exercise: Exercise,
        environment: Environment,
        dt_s: float,
        parameters: TuningParameters,
        rng: np.random.Generator,
    ) -> None:
        self.changes = changes_up_to(parameters.max_change)
        self.q = [[0.0] * len(self.changes) for _ in tree.leaves]
        self.updates = [[0] * len(self.changes) for _ in tree.leaves]
        self.steps = 0
        self._commands: list[list[Command]] = [
            [changed(leaf, change)[:2] for change in self.changes] for leaf in tree.wheel_leaves
        ]
        self._sense = observation_of(tree.behavior).sense
        self._answer = tree.answer
        self._exercise = exercise
        self._environment = environment
        self._dt_s = dt_s
        self._parameters = parameters
        self._rng = rng

    def drive(self, epsilon: float) -> None:
        """Drives an episode from a random start, and learns from it."""
        exercise, parameters, step = self._exercise, self._parameters, self._environment.step
        world = self._environment.reset(int(self._rng.integers(2**63)))
        rewards: list[float] = []
        pending: deque[_Decision] = deque()
        leaf_id, decided_at, command = NO_LEAF, 0, (0.0, 0.0)
        while not (exercise.arrived(world) or world.ended or len(rewards) >= exercise.max_steps):
            other = exercise.other_driver(world)
            if other is not None:
                leaf_id = NO_LEAF  # when the behavior drives again, it decides
            else:
                now = self._leaf_of(world)
                if now != leaf_id or len(rewards) - decided_at >= parameters.hold_steps:
                    while pending and len(rewards) - pending[0].step >= parameters.credit_steps:
                        self._learn(pending.popleft(), rewards, max(self.q[now]))
                    leaf_id, decided_at = now, len(rewards)
                    action = self._decide(leaf_id, epsilon)
                    pending.append(_Decision(leaf_id, action, decided_at))
                    command = self._commands[leaf_id][action]
            next_world = step(*(other or command))
            rewards.append(exercise.reward(world, next_world, self._dt_s))
            world = next_world
        ended = exercise.arrived(world) or world.terminated
        value = 0.0 if ended else max(self.q[self._leaf_of(world)])
        for decision in pending:
            self._learn(decision, rewards, value)
        self.steps += len(rewards)

    def _leaf_of(self, world: World) -> int:
        return self._answer(self._sense(world))[0]

    def _decide(self, leaf_id: int, epsilon: float) -> int:
        if self._rng.random() < epsilon:
            return int(self._rng.integers(len(self.changes)))
        return greedy(self.q[leaf_id])

    def _learn(self, decision: _Decision, rewards: Sequence[float], next_value: float) -> None:
        leaf_id, action, since = decision
        self.updates[leaf_id][action] += 1
        alpha = step_size(self._parameters.learning_rate, self.updates[leaf_id][action])
        target = smdp_target(rewards[since:], self._parameters.discount, next_value)
        self.q[leaf_id][action] = updated_q(self.q[leaf_id][action], target, alpha)
