"""The learner `fbql_value`: eqs. 5 and 6 of the paper repaired, so that credit goes to the behavior that drove.
Weights follow a learned Q.

It is TD(lambda) (Sutton & Barto, 12) for action values that are linear in tile-coded features, on the trajectories of a
softmax policy.

Kept from the paper's FBQL: a Q for each behavior, the bootstrap of eq. 5, weights that follow Q, guided episodes first.
Replaced: the reward that eq. 5 shares out by weights, by the whole reward for the behavior that drove; eq. 6's jump of
the argmax, by a soft maximum; the table, by features that add up. docs/fusion.md explains why.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fbql_fusion.core.learners.features import Situation
from fbql_fusion.core.learners.held_decisions import HeldDecisions, Holding, Values, per_step
from fbql_fusion.core.learners.linear import CAPACITY, Floats, row_sum
from fbql_fusion.core.learners.trajectories import Trajectory, minibatches
from fbql_fusion.core.learners.value import equations as eq
from fbql_fusion.core.learners.value.parameters import ValueParameters
from fbql_fusion.core.tasks.interface import Guide, Task


class Targets(NamedTuple):
    """The learning targets of the T decisions of an episode."""

    active: NDArray[np.int64]
    """[T, F]"""
    drivers: NDArray[np.int64]
    """[T]"""
    weights: Floats
    """w before the update, [T, n]."""
    lambda_returns: Floats
    """G of eq. 20, [T]."""


class FbqlValue(HeldDecisions):
    """TD(lambda) for action values (see the module)."""

    kind = "fbql_value"

    def __init__(
        self, parameters: ValueParameters, task: Task[Any, Any, Any], guide: Guide, generator: np.random.Generator
    ) -> None:
        holding = Holding.of(
            task,
            parameters.fbql_value_durations_s,
            parameters.fbql_value_play,
            parameters.fbql_value_patience,
            per_step(parameters.fbql_value_discount, parameters.fbql_discount_period_s, task),
            parameters.fbql_value_batch_episodes,
            world_tilings=0,
        )
        super().__init__(parameters, holding, task, guide, generator)
        self._own = parameters
        self._values = np.zeros((CAPACITY, self._behaviors + 1))
        """theta and U, see `equations`."""

    @property
    def _temperature(self) -> float:
        return self._decayed(self._own.fbql_value_temperature_first, self._own.fbql_value_temperature_last)

    @property
    def _exploration(self) -> float:
        return self._decayed(self._own.fbql_value_exploration_first, self._own.fbql_value_exploration_last)

    def _decayed(self, first: float, last: float) -> float:
        """Eq. 18."""
        return eq.decayed(first, last, self._own.fbql_value_halving, self._episodes)

    def _evaluate(self, active: Sequence[int], situation: Situation) -> Values:
        """Eqs. 16 and 17."""
        *theta, shared = row_sum(self._values, active)
        weights = eq.soft_weights(theta, self._temperature, self._exploration, situation.mask)
        return weights, eq.values_of(theta, shared, weights)

    def _learn_first(self) -> None:
        self._update()

    def _learn_waiting(self) -> None:
        if self._waiting[-1].guided or self._is_batch():
            self._update()

    def _update(self) -> None:
        """Eqs. 19 and 20 on all waiting episodes, guided or not."""
        p = self._own
        self._grow_tables()
        parts = [self._targets(each) for each in self._waiting]
        self._waiting = []
        every = Targets(*(np.concatenate(part) for part in zip(*parts, strict=True)))
        rate = self._decayed(p.fbql_value_rate_first, p.fbql_value_rate_last)
        for _ in range(p.fbql_value_passes):
            for some in minibatches(len(every.drivers), p.fbql_value_minibatch, self._generator):
                eq.move_towards(
                    self._values,
                    every.active[some],
                    every.drivers[some],
                    every.weights[some],
                    every.lambda_returns[some],
                    rate,
                    p.fbql_value_shared_rate,
                )
        self._updates += 1

    def _targets(self, trajectory: Trajectory) -> Targets:
        """Eqs. 19 and 20 with the current values."""
        active = np.array(trajectory.rows, dtype=np.int64)
        drivers = np.array(trajectory.drivers, dtype=np.int64)
        total = self._values[active].sum(axis=1)
        theta, shared = total[:, :-1], total[:, -1]
        weights = eq.soft_weights_of_all(theta, self._temperature, self._exploration, np.array(trajectory.masks))
        q = eq.values_of_all(theta, shared, weights)
        if trajectory.terminated:
            q[-1] = 0.0
        rewards, discounts = np.array(trajectory.rewards), np.array(trajectory.discounts)
        returns = eq.lambda_returns(rewards, discounts, drivers, q, weights, self._own.fbql_value_trace)
        return Targets(active[:-1], drivers, weights[:-1], returns)

    def _tables(self) -> dict[str, Floats]:
        return {"values": self._values}

    def _set_tables(self, tables: Mapping[str, Floats]) -> None:
        self._values = tables["values"]
