"""Tabular Q-learning that selects one behavior in each joint state, and holds it for some steps.

Watkins's Q-learning over options that last k steps (Sutton, Precup & Singh 1999, eq. 13): the plainest method that learns
from the same joint states and rewards as eq. 5, with the full reward to the behavior that drove, and no weights.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fbql_studies.peers.course import Course
from fbql_studies.peers.team_env import SelectionEnv


@dataclass(frozen=True)
class TabularParameters:
    """Settings, chosen on tuning seeds and on the shipped trees."""

    hold_steps: int = 10
    """Steps that a behavior drives before the next is selected."""
    learning_rate: float = 0.1
    discount: float = 0.9995
    """Per step of the simulator."""
    epsilon_start: float = 0.1
    """Share of random selections at first; it falls linearly to `epsilon_end` over `epsilon_share` of the budget."""
    epsilon_end: float = 0.02
    epsilon_share: float = 0.5
    initial_q: float = 5.0
    """Above the value of most joint states, so that untried behaviors are tried."""


class TabularQ:
    """Q(s, B_i) for the joint states that were visited: memory grows with them."""

    def __init__(self, behaviors: int, parameters: TabularParameters) -> None:
        self._parameters = parameters
        self._behaviors = behaviors
        self._rows: dict[bytes, list[float]] = {}

    def __len__(self) -> int:
        """Joint states with a row."""
        return len(self._rows)

    def row(self, joint_state: NDArray[np.int64]) -> list[float]:
        """Q of a joint state, length n; a fresh one if it has none. Reading does not create a row."""
        found = self._rows.get(joint_state.tobytes())
        return [self._parameters.initial_q] * self._behaviors if found is None else found

    def select(self, joint_state: NDArray[np.int64], epsilon: float, rng: np.random.Generator) -> int:
        """A behavior with the largest Q; a random one among ties, and with probability `epsilon` any behavior at
        random."""
        row = self.row(joint_state)
        if rng.random() < epsilon:
            return int(rng.integers(len(row)))
        best = max(row)
        tied = [i for i, q in enumerate(row) if q == best]
        return tied[int(rng.integers(len(tied)))] if len(tied) > 1 else tied[0]

    def update(self, joint_state: NDArray[np.int64], behavior: int, target: float) -> None:
        """Moves Q(s, B_i) towards a target by the learning rate."""
        row = self._rows.setdefault(joint_state.tobytes(), self.row(joint_state))
        row[behavior] += self._parameters.learning_rate * (target - row[behavior])


def train(env: SelectionEnv, budget: int, seed: int, parameters: TabularParameters) -> tuple[TabularQ, Course]:
    """Learns until the budget of simulated steps is used up. R + gamma^k max Q(s'); nothing follows a terminal state."""
    q, course, rng = TabularQ(len(env.behaviors), parameters), Course(budget), np.random.default_rng(seed)
    joint_state, _ = env.reset(seed=seed)
    while not course.is_over:
        decay = min(course.share / parameters.epsilon_share, 1.0)
        epsilon = parameters.epsilon_start + decay * (parameters.epsilon_end - parameters.epsilon_start)
        behavior = q.select(joint_state, epsilon, rng)
        following, reward, terminated, truncated, info = env.step(behavior)
        later = 0.0 if terminated else parameters.discount ** info["steps"] * max(q.row(following))
        q.update(joint_state, behavior, reward + later)
        ended = terminated or truncated
        course.add(info, ended)
        joint_state = env.reset()[0] if ended else following
    return q, course


def acts_by(q: TabularQ, epsilon: float, seed: int) -> Callable[[Any], int]:
    """Frozen play: the largest Q, and with probability `epsilon` any behavior."""
    rng = np.random.default_rng(seed)
    return lambda joint_state: q.select(joint_state, epsilon, rng)
