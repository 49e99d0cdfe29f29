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
from fbql_common.core.types import DRIVER_BLEND, BehaviorOutput, Phase, World
from numpy.typing import NDArray

from fbql_fusion.core import policy_gradient as eq
from fbql_fusion.core.controllers import Selection, Transition
from fbql_fusion.core.experience import Batch, Episode
from fbql_fusion.core.features import Features, Resolution, Scales, Situation
from fbql_fusion.core.generator_state import generator_state, set_generator_state
from fbql_fusion.core.joint_state import JointState
from fbql_fusion.core.parameters import FusionParameters

FIRST_EPISODES = 20
"""Episodes that the scales are made of where none is guided."""
_FIRST_BATCH = 2
_BATCH_GROWTH = 20
"""Episodes after which a batch has one episode more."""
_MEAN_UPDATES = 50
"""The mean that is played goes over about so many updates."""
_CAPACITY = 1 << 14


class Fbql:
    """The learner (see the module). One decision is held for `fbql_hold_steps` steps."""

    kind = "fbql"

    def __init__(self, parameters: FusionParameters, generator: np.random.Generator) -> None:
        self._parameters = parameters
        self._generator = generator
        self._behaviors = n = len(parameters.behaviors)
        self._resolution = Resolution(
            parameters.fbql_leaf_pairs,
            parameters.fbql_pair_tilings,
            parameters.fbql_pair_tiles,
            parameters.fbql_joint_tilings,
            parameters.fbql_joint_tiles,
        )
        self._alone = tuple(tuple(1.0 if i == driver else 0.0 for i in range(n)) for driver in range(n))
        self._features: Features | None = None
        self._theta = np.zeros((_CAPACITY, n))
        self._value = np.zeros(_CAPACITY)
        self._mean = np.zeros((0, n))
        self._episodes = self._updates = self._averaged = 0
        self._table: list[list[float]] = []
        """Theta, or its mean where nothing is learned, as lists: a decision looks into a few rows only."""
        self._waiting: list[Episode] = []
        """Ended episodes that were not learned from yet."""

        self._phase = Phase.EVALUATION
        self._episode: Episode | None = None
        """The episode under way; None where nothing is, or can be, learned from it."""
        self._linked = False
        """Whether a transition led to the world state that is selected for next."""
        self._held_for = 0
        self._weights: tuple[float, ...] = (1.0 / n,) * n
        self._driver = DRIVER_BLEND
        self._visits: dict[JointState, int] = {}

    def __len__(self) -> int:
        """Number of features met so far."""
        return 0 if self._features is None else len(self._features)

    def begin_episode(self, phase: Phase) -> None:
        """A new episode. What was not ended before is not learned from."""
        self._phase = phase
        if self._features is None and self._waiting and phase is not Phase.GUIDED:
            guided = self._waiting[0].guided
            if guided or len(self._waiting) >= FIRST_EPISODES or phase is Phase.EVALUATION:
                self._look_back()
        self._episode = None if phase is Phase.EVALUATION else Episode(guided=phase is Phase.GUIDED)
        self._linked = True
        self._held_for = 0
        self._visits.clear()
        m = len(self)
        frozen = phase is Phase.EVALUATION and self._averaged
        self._table = (self._mean if frozen else self._theta[:m]).tolist()

    def select(self, world: World, joint_state: JointState, outputs: Sequence[BehaviorOutput | None]) -> Selection:
        """The held behavior alone, or, every `fbql_hold_steps` steps, the one that is decided on now."""
        complete = None not in outputs
        if self._episode is not None and not (self._linked and complete):
            self._episode = None  # something is missing: the rest of it can't be told what it led to
        self._linked = False
        if self._held_for and complete and not world.ended:
            self._held_for -= 1
            if self._driver == DRIVER_BLEND:
                self._weights = self._weights_in(self._situation(joint_state, outputs))
            return self._weights, self._driver, ()
        situation = self._situation(joint_state, outputs)
        if world.ended:
            if self._episode is not None:
                self._end(self._episode, situation)
            return self._weights, self._driver, ()
        self._decide(situation, outputs)
        self._held_for = self._parameters.fbql_hold_steps - 1 if complete else 0
        return self._weights, self._driver, ()

    def _situation(self, joint_state: JointState, outputs: Sequence[BehaviorOutput | None]) -> Situation:
        return Situation(joint_state, tuple([() if x is None else x.observation for x in outputs]))

    def _weights_in(self, situation: Situation) -> tuple[float, ...]:
        """Eq. 7."""
        active = () if self._features is None else self._features.known(situation)
        return eq.softmax(eq.preferences(self._table, active, self._behaviors))

    def _decide(self, situation: Situation, outputs: Sequence[BehaviorOutput | None]) -> None:
        """Who drives for the next steps."""
        n = self._behaviors
        episode = self._episode
        active: list[int] | None = None
        if self._features is None:
            weights = (1.0 / n,) * n
        elif episode is None:
            weights = self._weights_in(situation)
        else:
            active = self._features.active(situation)
            weights = eq.softmax(eq.preferences(self._table, active, n))
        live = [w if x is not None else 0.0 for w, x in zip(weights, outputs, strict=True)]
        joint_state = situation.joint_state
        visits = self._visits[joint_state] = self._visits.get(joint_state, 0) + 1
        patience = self._parameters.fbql_patience
        play = "drawn" if self._phase is not Phase.EVALUATION or 0 < patience < visits else self._parameters.fbql_play
        if play == "blended" or not any(live):
            self._weights, self._driver = weights, DRIVER_BLEND
            return
        driver = self._drawn(live) if play == "drawn" else live.index(max(live))
        self._weights, self._driver = self._alone[driver], driver
        if episode is not None:
            episode.begin_decision(situation, active, driver, weights[driver])

    def _drawn(self, weights: Sequence[float]) -> int:
        """One of the behaviors, by its weight."""
        left = self._generator.random() * sum(weights)
        for driver, weight in enumerate(weights):
            left -= weight
            if left < 0.0:
                return driver
        return max(driver for driver, weight in enumerate(weights) if weight)

    def learn(self, transition: Transition) -> None:
        """Adds a step to the decision under way. What was decided is learned at the end of a batch of episodes."""
        self._linked = True
        if self._episode is None:
            return
        if not self._episode.add_step(transition.driver, transition.reward, self._parameters.fbql_discount):
            self._episode = None
        elif transition.terminated:
            self._episode.terminated = True

    def _end(self, episode: Episode, situation: Situation) -> None:
        """The episode is whole: `situation` is what it ended in."""
        self._episode = None
        episode.end(situation, None if self._features is None else self._features.active(situation))
        self._waiting.append(episode)
        if episode.guided:
            return
        self._episodes += 1
        due = min(self._parameters.fbql_batch_episodes, _FIRST_BATCH + self._episodes / _BATCH_GROWTH)
        if self._features is not None and len(self._waiting) >= due:
            self._improve()

    def _look_back(self) -> None:
        """After the first episodes: makes the scales of what was sensed in them, and learns from them."""
        parameters = self._parameters
        situations = [situation for episode in self._waiting for situation in episode.situations]
        scales = Scales.of(situations, parameters.fbql_mirror)
        offsets = Features.random_offsets(self._resolution, len(scales.knots), self._generator)
        self._features = features = Features(scales, self._resolution, offsets)
        for episode in self._waiting:
            episode.active = [features.active(situation) for situation in episode.situations]
            episode.situations = []
        if self._waiting[0].guided:
            self._follow()
        else:
            self._improve()

    def _follow(self) -> None:
        """Eqs. 8 and 12 on the guided episodes: the weights of the guide's drivers grow, and V learns what they led to."""
        parameters = self._parameters
        batch = self._batch()
        for _ in range(parameters.fbql_guide_passes):
            for some in batch.minibatches(parameters.fbql_minibatch, self._generator):
                active = batch.active[some]
                step = eq.guided_step(eq.weights_of(self._theta, active), batch.driver[some])
                eq.add_shared(self._theta, active, step, parameters.fbql_rate)
                self._learn_value(active, batch.returns[some])

    def _improve(self) -> None:
        """Eqs. 9 to 12 on a batch of episodes."""
        parameters = self._parameters
        batch = self._batch()
        advantage = eq.normalised_advantages(batch.advantages)
        rate = parameters.fbql_rate * min(1.0, max(0.1, 2.0 * (1.0 - self._episodes / parameters.fbql_horizon)))
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
                        parameters.fbql_entropy,
                    )
                    eq.add_shared(self._theta, active, step, rate)
                self._learn_value(active, batch.returns[some])
        self._updates += 1
        if 3 * self._episodes >= 2 * parameters.fbql_horizon:
            self._average()

    def _learn_value(self, active: NDArray[np.int64], returns: eq.Floats) -> None:
        """Eq. 12."""
        surprise = returns - self._value[active].sum(axis=1)
        eq.add_shared(self._value, active, surprise, self._parameters.fbql_value_rate)

    def _batch(self) -> Batch:
        """The waiting episodes, valued by V as it is now."""
        self._make_room()
        batch = Batch.of(self._waiting, self._value, self._parameters.fbql_trace)
        self._waiting = []
        return batch

    def _make_room(self) -> None:
        """The tables get rows for the features that were met since."""
        capacity = len(self._theta)
        while capacity < len(self):
            capacity *= 2
        if capacity > len(self._theta):
            more = capacity - len(self._theta)
            self._theta = np.concatenate([self._theta, np.zeros((more, self._behaviors))])
            self._value = np.concatenate([self._value, np.zeros(more)])

    def _average(self) -> None:
        """The mean of theta over the last updates, which is what plays when nothing is learned."""
        m = len(self)
        mean = np.zeros((m, self._behaviors))
        mean[: len(self._mean)] = self._mean
        self._averaged = min(self._averaged + 1, _MEAN_UPDATES)
        mean += (self._theta[:m] - mean) / self._averaged
        self._mean = mean

    def to_arrays(self) -> dict[str, NDArray[Any]]:
        """Everything learned, and what an exact continuation takes: the generator, and the episodes that wait.

        theta and mean float64 [m, n], value float64 [m] (m features), counts int64 [3] (episodes, updates, updates in
        the mean), generator uint64 [6]; of the features see `Features.to_arrays`, of the episodes `experience`.
        Guided episodes that wait for the end of guidance are not kept.
        """
        arrays: dict[str, NDArray[Any]] = {
            "counts": np.array([self._episodes, self._updates, self._averaged], dtype=np.int64),
            "generator": generator_state(self._generator),
        }
        if self._features is None:
            return arrays
        self._make_room()
        m = len(self)
        mean = np.zeros((m, self._behaviors))
        mean[: len(self._mean)] = self._mean
        arrays |= {"theta": self._theta[:m].copy(), "mean": mean, "value": self._value[:m].copy()}
        return arrays | self._features.to_arrays() | Batch.to_arrays(self._waiting)

    def load_arrays(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Takes over what `to_arrays` gave. Raises BadInput."""
        n = self._behaviors
        _check(arrays, {"counts": ("i", (3,)), "generator": ("u", (6,))})
        if "keys" in arrays:
            m = len(arrays["keys"]) if arrays["keys"].ndim else 0
            kinds = {"keys": ("i", (m,)), "theta": ("f", (m, n)), "mean": ("f", (m, n)), "value": ("f", (m,))}
            _check(arrays, kinds | {"lengths": ("i", (n,))})
            for name, kind in {"knots": "f", "signed": "b", "offsets": "f"}.items():
                _check(arrays, {name: (kind, arrays[name].shape if name in arrays else ())})
            self._features = Features.from_arrays(arrays, self._resolution)
            self._waiting = Batch.from_arrays(arrays, m, n)
            self._theta = np.zeros((max(m, _CAPACITY), n))
            self._theta[:m] = arrays["theta"]
            self._value = np.zeros(max(m, _CAPACITY))
            self._value[:m] = arrays["value"]
            self._mean = arrays["mean"].copy()
        if (arrays["counts"] < 0).any():
            raise BadInput("the policy's array 'counts' has a number below 0")
        self._episodes, self._updates, self._averaged = arrays["counts"].tolist()
        set_generator_state(self._generator, arrays["generator"])


def _check(arrays: Mapping[str, NDArray[Any]], expected: Mapping[str, tuple[str, tuple[int, ...]]]) -> None:
    """Raises BadInput where an array is missing or of another kind or shape."""
    for name, (kind, shape) in expected.items():
        if name not in arrays:
            raise BadInput(f"the policy has no array '{name}'")
        found = arrays[name]
        if found.dtype.kind != kind or found.shape != shape:
            raise BadInput(
                f"the policy's array '{name}' is {found.dtype} {list(found.shape)}, expected kind {kind} {list(shape)}"
            )
