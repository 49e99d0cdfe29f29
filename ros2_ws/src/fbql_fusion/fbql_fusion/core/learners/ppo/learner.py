"""The learner `fbql`: proximal policy optimization (PPO; Schulman et al. 2017, arXiv 1707.06347) over tile-coded features.

- The policy: a softmax of preferences, linear in tile-coded features, draws one behavior, which drives for several steps:
  an option of a semi-Markov decision process (Sutton, Precup & Singh 1999).
- The critic is asymmetric (Pinto et al. 2018, arXiv 1710.06542): it also sees inputs that only the task knows. Its
  advantages are GAE's (Schulman et al. 2016, arXiv 1506.02438).
- Warm start: behavioral cloning of the guide, such as Subsumption, in the guided episodes; or the guide as a prior: the
  behavior that it would choose is one more feature, whose preference for that behavior starts at kappa (`fbql_prior`).

Kept from the paper's FBQL: behaviors side by side, a weight for each, learned in the joint state from sparse rewards,
guided episodes first. Replaced: eq. 5's shared target, by a critic of the state and credit for the behavior that drove;
eq. 6's jump of the argmax, by a gradient; the table, by features. docs/fusion.md explains why.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from fbql_common.core.types import Phase
from numpy.typing import NDArray

from fbql_fusion.core.learners.features import Features, Situation
from fbql_fusion.core.learners.held_decisions import HeldDecisions, Holding, Values, per_step
from fbql_fusion.core.learners.linear import CAPACITY, Floats, row_sum, value_sums
from fbql_fusion.core.learners.ppo.equations import (
    Batch,
    Rates,
    advantages,
    approx_kl,
    cloning_pass,
    normalised_advantages,
    policy_pass,
    softmax,
    weights_of,
)
from fbql_fusion.core.learners.ppo.parameters import PpoParameters, PpoUpdateParameters
from fbql_fusion.core.learners.trajectories import Trajectory
from fbql_fusion.core.tasks.interface import Guide, Imagined, Task


def batch_of(trajectories: Sequence[Trajectory], value: Floats, trace: float, active_features: int) -> Batch:
    """Combines trajectories. `value` is V's table, [features], `active_features` F."""
    inputs: list[NDArray[np.int64]] = []
    found: list[Floats] = []
    targets: list[Floats] = []
    for each in trajectories:
        rows = np.array(each.rows, dtype=np.int64)
        values = value_sums(value, rows)
        own = values[:-1].copy()
        if each.terminated:
            values[-1] = 0.0
        advantage = advantages(np.array(each.rewards), np.array(each.discounts), values, trace)
        inputs.append(rows[:-1])
        found.append(advantage)
        targets.append(advantage + own)
    every = np.concatenate(inputs)
    return Batch(
        np.ascontiguousarray(every[:, :active_features]),
        every,
        np.array([driver for each in trajectories for driver in each.drivers], dtype=np.int64),
        np.array([mask for each in trajectories for mask in each.masks[:-1]]),
        np.array([old_prob for each in trajectories for old_prob in each.old_probs]),
        np.concatenate(found),
        np.concatenate(targets),
    )


def holding_of(
    parameters: PpoUpdateParameters,
    durations_s: tuple[float, float],
    batch_episodes: int,
    task: Task[Any, Any, Any],
    has_prior: bool = False,
) -> Holding:
    """How decisions are made. `durations_s`: how long one is held while learning, and when not [s]."""
    return Holding.of(
        task,
        durations_s,
        parameters.fbql_play,
        parameters.fbql_patience,
        per_step(parameters.fbql_discount, parameters.fbql_discount_period_s, task),
        batch_episodes,
        parameters.fbql_world_tilings,
        has_prior,
    )


def batch_of_imagined(imagined: Imagined, value: Floats, trace: float, active_features: int, behaviors: int) -> Batch:
    """The same for imagined episodes, in which every behavior may drive. `behaviors` is n."""
    values = value_sums(value, imagined.rows)
    ends = np.cumsum(imagined.lengths + 1) - 1
    """The rows of the situations in which the episodes ended."""
    own = np.delete(values, ends)
    values[ends[imagined.terminated]] = 0.0
    advantage = np.empty(len(own))
    first = 0
    for length, end in zip(imagined.lengths.tolist(), ends.tolist(), strict=True):
        decisions = slice(first, first + length)
        advantage[decisions] = advantages(
            imagined.rewards[decisions], imagined.discounts[decisions], values[end - length : end + 1], trace
        )
        first += length
    every = np.delete(imagined.rows, ends, axis=0)
    return Batch(
        np.ascontiguousarray(every[:, :active_features]),
        every,
        imagined.drivers,
        np.ones((len(every), behaviors), dtype=np.bool_),
        imagined.old_probs,
        advantage,
        advantage + own,
    )


class Ppo(HeldDecisions):
    """PPO (see the module). What it learns from, and when, is up to the learner: `Fbql`, or `dyna.learner.FbqlModel`.

    Args:
        holding: how decisions are made.
        passes: passes over a batch.
        prior: kappa, the preference that an untrained policy has for the behavior that the guide would choose.
    """

    def __init__(
        self,
        parameters: PpoUpdateParameters,
        holding: Holding,
        passes: int,
        prior: float,
        task: Task[Any, Any, Any],
        guide: Guide,
        generator: np.random.Generator,
    ) -> None:
        super().__init__(parameters, holding, task, guide, generator)
        self._ppo = parameters
        self._passes = passes
        self._prior = prior
        self._theta = np.zeros((CAPACITY, self._behaviors))
        self._value = np.zeros(CAPACITY)
        self._rates = Rates(parameters.fbql_rate, parameters.fbql_value_rate, parameters.fbql_clip)

    def _evaluate(self, active: Sequence[int], situation: Situation) -> Values:
        """Eq. 10."""
        preferences = row_sum(self._theta, active)
        if self._features is None and situation.guide is not None and situation.guide >= 0:
            preferences[situation.guide] += self._prior
        return softmax(preferences, situation.mask), ()

    def _set_prior(self, features: Features) -> None:
        """The preference for the behavior that the guide would choose starts at kappa."""
        for behavior in range(self._behaviors):
            self._theta[features.of_guide(behavior), behavior] = self._prior

    def _learn_waiting(self) -> None:
        if self._waiting[-1].guided:
            guided = self._waiting.pop()
            self._clone([guided], [self._is_example(guided)])
        elif self._is_batch():
            self._update()

    def _learn_first(self) -> None:
        guided = [each for each in self._waiting if each.guided]
        if guided:
            self._waiting = [each for each in self._waiting if not each.guided]
            examples = [self._is_example(each) for each in guided]
            self._clone(guided, examples if any(examples) else [True] * len(guided))
        else:
            self._update()

    def _is_example(self, guided: Trajectory) -> bool:
        return guided.succeeded or self._ppo.fbql_imitate_failures

    def _clone(self, guided: Sequence[Trajectory], examples: Sequence[bool]) -> None:
        """The warm start, eqs. 11 and 15 on guided episodes: V learns their outcomes, and the weights clone the guide
        in those that are examples. An episode that did not end in a goal is not an example, unless the guide never
        succeeded."""
        p = self._ppo
        batch = self._batch(guided)
        example = np.repeat(examples, [len(each.drivers) for each in guided])
        for _ in range(p.fbql_guide_passes):
            order = self._generator.permutation(len(example))
            shuffled = batch.in_order(order)
            cloning_pass(self._theta, self._value, shuffled, p.fbql_minibatch, example[order], self._rates)

    def _update(self) -> None:
        """PPO's update on the waiting episodes."""
        batch = self._batch(self._waiting)
        self._waiting = []
        self._improve(batch, self._generator)

    def _improve(self, batch: Batch, generator: np.random.Generator) -> None:
        """PPO's update, eqs. 12 to 15, on a batch of episodes played by the present weights.

        Args:
            generator: draws the order of the decisions.
        """
        p = self._ppo
        batch = batch._replace(advantages=normalised_advantages(batch.advantages))
        for _ in range(self._passes):
            kl = approx_kl(weights_of(self._theta, batch.active, batch.masks), batch.drivers, batch.old_probs)
            shuffled = batch.in_order(generator.permutation(len(batch.drivers)))
            policy_pass(self._theta, self._value, shuffled, p.fbql_minibatch, kl <= p.fbql_divergence, self._rates)
        self._updates += 1

    def _batch(self, trajectories: Sequence[Trajectory]) -> Batch:
        """Their decisions, with advantages by V as it is now."""
        self._grow_tables()
        assert self._features is not None
        return batch_of(trajectories, self._value, self._ppo.fbql_trace, self._features.active_features)

    def _tables(self) -> dict[str, Floats]:
        return {"theta": self._theta, "value": self._value}

    def _set_tables(self, tables: Mapping[str, Floats]) -> None:
        self._theta, self._value = tables["theta"], tables["value"]


class Fbql(Ppo):
    """PPO on the episodes that it plays."""

    kind = "fbql"

    def __init__(
        self, parameters: PpoParameters, task: Task[Any, Any, Any], guide: Guide, generator: np.random.Generator
    ) -> None:
        holding = holding_of(
            parameters, parameters.fbql_durations_s, parameters.fbql_batch_episodes, task, parameters.fbql_prior > 0.0
        )
        super().__init__(parameters, holding, parameters.fbql_passes, parameters.fbql_prior, task, guide, generator)
        self._may_explore = parameters.fbql_explore

    def begin_episode(self, phase: Phase) -> None:
        """See `Controller`."""
        super().begin_episode(phase)
        if phase is Phase.LEARNING and self._features is not None:
            self._explores = self._may_explore

    def _can_be_counts(self) -> bool:
        return 0 <= self._updates <= self._episodes
