"""FBQL that learns: each behavior's weight depends on the joint leaves and on what is sensed, learned from goals alone.

What is kept of the paper's FBQL: behaviors side by side, a weight for each, learned in the joint state from sparse
rewards, guided episodes first. What is replaced: eq. 5's shared target, by a critic of the state and the credit of the
behavior that drove; eq. 6's jump of the argmax, by a gradient; the table, by features. docs/fusion.md says why.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from fbql_common.core.errors import BadInput
from numpy.typing import NDArray

from fbql_fusion.core import policy_gradient as eq
from fbql_fusion.core.experience import Batch, Episode
from fbql_fusion.core.generator_state import generator_state, set_generator_state
from fbql_fusion.core.held_decisions import HeldDecisions, Holding, Judgement
from fbql_fusion.core.parameters import FusionParameters
from fbql_fusion.core.policy_arrays import CAPACITY, check_arrays, grown, padded

_ALWAYS = {"counts": ("i", (2,)), "generator": ("u", (6,))}
"""Kind and shape of the arrays that every policy has."""


class Fbql(HeldDecisions):
    """The learner (see the module). One decision is held for `fbql_hold_steps` steps while it learns."""

    kind = "fbql"

    def __init__(self, parameters: FusionParameters, generator: np.random.Generator) -> None:
        holding = Holding(
            parameters.fbql_hold_steps,
            parameters.fbql_play_steps,
            parameters.fbql_play,
            parameters.fbql_patience,
            parameters.fbql_discount,
            parameters.fbql_batch_episodes,
            parameters.fbql_world_tilings,
        )
        super().__init__(parameters, holding, generator)
        n = self._behaviors
        self._theta = np.zeros((CAPACITY, n))
        self._value = np.zeros(CAPACITY)
        self._updates = 0

    def _judge(self, active: Sequence[int]) -> Judgement:
        """Eq. 10."""
        return eq.softmax(eq.preferences(self._theta, active)), ()

    def _learn_waiting(self) -> None:
        if self._waiting[-1].guided:
            episode = self._waiting.pop()
            self._follow([episode], [self._is_example(episode)])
        elif self._is_batch():
            self._improve()

    def _learn_first(self) -> None:
        guided = [episode for episode in self._waiting if episode.guided]
        if guided:
            self._waiting = [episode for episode in self._waiting if not episode.guided]
            examples = [self._is_example(episode) for episode in guided]
            self._follow(guided, examples if any(examples) else [True] * len(guided))
        else:
            self._improve()

    def _is_example(self, guided: Episode) -> bool:
        return guided.succeeded or self._parameters.fbql_imitate_failures

    def _follow(self, guided: Sequence[Episode], examples: Sequence[bool]) -> None:
        """Eqs. 11 and 15 on guided episodes: V learns what they led to, and in the examples among them the weights of the
        drivers grow. One that did not end in a goal is no example, unless the guide never succeeded at first."""
        parameters = self._parameters
        batch = self._batch(guided)
        example = np.repeat(examples, [len(episode.drivers) for episode in guided])
        for _ in range(parameters.fbql_guide_passes):
            for some in batch.minibatches(parameters.fbql_minibatch, self._generator):
                self._learn_value(batch.valued[some], batch.returns[some])
                shown = some[example[some]]
                active = batch.active[shown]
                step = eq.guided_step(eq.weights_of(self._theta, active), batch.driver[shown])
                eq.add_shared(self._theta, active, step, parameters.fbql_rate)

    def _improve(self) -> None:
        """Eqs. 12 to 15 on a batch of episodes."""
        parameters = self._parameters
        batch = self._batch(self._waiting)
        self._waiting = []
        advantage = eq.normalised_advantages(batch.advantages)
        for _ in range(parameters.fbql_passes):
            gone = eq.divergence(eq.weights_of(self._theta, batch.active), batch.driver, batch.chance)
            for some in batch.minibatches(parameters.fbql_minibatch, self._generator):
                active = batch.active[some]
                if gone <= parameters.fbql_divergence:
                    step = eq.clipped_step(
                        eq.weights_of(self._theta, active),
                        batch.driver[some],
                        batch.chance[some],
                        advantage[some],
                        parameters.fbql_clip,
                    )
                    eq.add_shared(self._theta, active, step, parameters.fbql_rate)
                self._learn_value(batch.valued[some], batch.returns[some])
        self._updates += 1

    def _learn_value(self, valued: NDArray[np.int64], returns: eq.Floats) -> None:
        """Eq. 15."""
        surprise = returns - self._value[valued].sum(axis=1)
        eq.add_shared(self._value, valued, surprise, self._parameters.fbql_value_rate)

    def _batch(self, episodes: Sequence[Episode]) -> Batch:
        """The decisions of episodes, valued by V as it is now."""
        self._make_room()
        assert self._features is not None
        return Batch.of(episodes, self._value, self._parameters.fbql_trace, self._features.active_features)

    def _make_room(self) -> None:
        """The tables get rows for the features that were met since."""
        self._theta = grown(self._theta, len(self))
        self._value = grown(self._value, len(self))

    def to_arrays(self) -> dict[str, NDArray[Any]]:
        """Everything learned, and what an exact continuation takes: the generator, and the episodes that wait.

        theta float64 [m, n], value float64 [m] (m features), counts int64 [2] (episodes, updates), generator uint64 [6]; of
        the features see `Features.to_arrays`, of the episodes `experience`. As long as there are no features, only counts
        and generator are there: guided episodes that wait for the end of guidance are not kept, nor the first ones where
        none is guided.
        """
        arrays: dict[str, NDArray[Any]] = {
            "counts": np.array([self._episodes, self._updates], dtype=np.int64),
            "generator": generator_state(self._generator),
        }
        if self._features is None:
            return arrays
        self._make_room()
        m = len(self)
        arrays |= {"theta": self._theta[:m].copy(), "value": self._value[:m].copy()}
        return arrays | self._features.to_arrays() | Batch.to_arrays(self._waiting)

    def load_arrays(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Takes over what `to_arrays` gave. Raises BadInput."""
        n = self._behaviors
        check_arrays(arrays, _ALWAYS)
        counts: list[int] = arrays["counts"].tolist()
        self._episodes, self._updates = counts
        if not 0 <= self._updates <= self._episodes:
            raise BadInput(f"the policy's array 'counts' is {counts}, which can't be")
        set_generator_state(self._generator, arrays["generator"])
        if arrays.keys() > _ALWAYS.keys() or self._updates:
            features = self._load_features(arrays, {"theta": (n,), "value": ()})
            self._waiting = Batch.from_arrays(arrays, features, n)
            self._theta = padded(arrays["theta"], max(len(features), CAPACITY))
            self._value = padded(arrays["value"], max(len(features), CAPACITY))
