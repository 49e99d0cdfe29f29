"""FBQL's repair by values: eqs. 5 and 6 with the credit where it belongs. The weights follow a Q that is learned.

What is kept of the paper's FBQL: a Q for each behavior, the bootstrap of eq. 5, weights that follow Q, guided episodes
first. What is replaced: the reward that eq. 5 shares out by weights, by the whole reward for the behavior that drove; eq.
6's jump of the argmax, by a soft maximum; the table, by features that add up. docs/fusion.md says why.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from fbql_common.core.errors import BadInput
from numpy.typing import NDArray

from fbql_fusion.core import value_equations as eq
from fbql_fusion.core.experience import Batch, Episode, minibatches
from fbql_fusion.core.generator_state import generator_state, set_generator_state
from fbql_fusion.core.held_decisions import HeldDecisions, Holding, Judgement
from fbql_fusion.core.parameters import FusionParameters
from fbql_fusion.core.policy_arrays import CAPACITY, check_arrays, grown, padded
from fbql_fusion.core.policy_gradient import Floats, preferences

_ALWAYS = {"counts": ("i", (2,)), "generator": ("u", (6,))}
"""Kind and shape of the arrays that every policy has."""


class Lesson(NamedTuple):
    """What the T decisions of an episode are to be learned as."""

    active: NDArray[np.int64]
    """[T, F]"""
    drivers: NDArray[np.int64]
    """[T]"""
    weights: Floats
    """w, before anything is learned from them, [T, n]"""
    goals: Floats
    """G of eq. 20, [T]"""


class FbqlValue(HeldDecisions):
    """The learner (see the module). One decision is held for `fbql_value_hold_steps` steps while it learns."""

    kind = "fbql_value"

    def __init__(self, parameters: FusionParameters, generator: np.random.Generator) -> None:
        holding = Holding(
            parameters.fbql_value_hold_steps,
            parameters.fbql_value_play_steps,
            parameters.fbql_value_play,
            parameters.fbql_value_patience,
            parameters.fbql_value_discount,
            parameters.fbql_value_batch_episodes,
            world_tilings=0,
        )
        super().__init__(parameters, holding, generator)
        self._values = np.zeros((CAPACITY, self._behaviors + 1))
        """theta and U, see `value_equations`."""
        self._updates = 0

    @property
    def _temperature(self) -> float:
        p = self._parameters
        return self._fallen(p.fbql_value_temperature_first, p.fbql_value_temperature_last)

    @property
    def _exploration(self) -> float:
        p = self._parameters
        return self._fallen(p.fbql_value_exploration_first, p.fbql_value_exploration_last)

    def _fallen(self, first: float, last: float) -> float:
        """Eq. 18."""
        return eq.fallen(first, last, self._parameters.fbql_value_halving, self._episodes)

    def _judge(self, active: Sequence[int]) -> Judgement:
        """Eqs. 16 and 17."""
        *theta, shared = preferences(self._values, active)
        weights = eq.soft_weights(theta, self._temperature, self._exploration)
        return weights, eq.values_of(theta, shared, weights)

    def _learn_first(self) -> None:
        self._improve()

    def _learn_waiting(self) -> None:
        if self._waiting[-1].guided or self._is_batch():
            self._improve()

    def _improve(self) -> None:
        """Eqs. 19 and 20 on all episodes that wait, guided or not."""
        p = self._parameters
        self._values = grown(self._values, len(self))
        lessons = [self._lesson(episode) for episode in self._waiting]
        self._waiting = []
        active = np.concatenate([lesson.active for lesson in lessons])
        drivers = np.concatenate([lesson.drivers for lesson in lessons])
        weights = np.concatenate([lesson.weights for lesson in lessons])
        goals = np.concatenate([lesson.goals for lesson in lessons])
        rate = self._fallen(p.fbql_value_rate_first, p.fbql_value_rate_last)
        for _ in range(p.fbql_value_passes):
            for some in minibatches(len(goals), p.fbql_value_minibatch, self._generator):
                eq.move_towards(
                    self._values,
                    active[some],
                    drivers[some],
                    weights[some],
                    goals[some],
                    rate,
                    p.fbql_value_shared_rate,
                )
        self._updates += 1

    def _lesson(self, episode: Episode) -> Lesson:
        """Eqs. 19 and 20 by the values as they are now."""
        active = np.array(episode.rows, dtype=np.int64)
        drivers = np.array(episode.drivers, dtype=np.int64)
        total = self._values[active].sum(axis=1)
        theta, shared = total[:, :-1], total[:, -1]
        weights = eq.soft_weights_of_all(theta, self._temperature, self._exploration)
        q = eq.values_of_all(theta, shared, weights)
        if episode.terminated:
            q[-1] = 0.0
        rewards, discounts = np.array(episode.rewards), np.array(episode.discounts)
        goals = eq.goals_of(rewards, discounts, drivers, q, weights, self._parameters.fbql_value_trace)
        return Lesson(active[:-1], drivers, weights[:-1], goals)

    def to_arrays(self) -> dict[str, NDArray[Any]]:
        """Everything learned, and what an exact continuation takes: the generator, and the episodes that wait.

        values float64 [m, n + 1] (m features), counts int64 [2] (episodes, updates), generator uint64 [6]; of the features
        see `Features.to_arrays`, of the episodes `experience`. As long as there are no features, only counts and generator
        are there: the first episodes, guided or not, are not kept.
        """
        arrays: dict[str, NDArray[Any]] = {
            "counts": np.array([self._episodes, self._updates], dtype=np.int64),
            "generator": generator_state(self._generator),
        }
        if self._features is None:
            return arrays
        m = len(self)
        self._values = grown(self._values, m)
        arrays["values"] = self._values[:m].copy()
        return arrays | self._features.to_arrays() | Batch.to_arrays(self._waiting)

    def load_arrays(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Takes over what `to_arrays` gave. Raises BadInput."""
        check_arrays(arrays, _ALWAYS)
        counts: list[int] = arrays["counts"].tolist()
        self._episodes, self._updates = counts
        if min(counts) < 0:
            raise BadInput(f"the policy's array 'counts' is {counts}, which can't be")
        set_generator_state(self._generator, arrays["generator"])
        if arrays.keys() > _ALWAYS.keys() or self._updates:
            features = self._load_features(arrays, {"values": (self._behaviors + 1,)})
            self._waiting = Batch.from_arrays(arrays, features, self._behaviors)
            self._values = padded(arrays["values"], max(len(features), CAPACITY))
