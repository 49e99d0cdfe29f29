"""What every FBQL that learns has in common: decisions that are held, episodes remembered until they are learned from.

It owns the features, the episode under way and how is played. What a decision is worth, and how that is learned, is for
the learner: `Fbql` (weights by a policy gradient) or `FbqlValue` (weights from values).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from math import isfinite
from typing import Any, NamedTuple

import numpy as np
from fbql_common.core.types import DRIVER_BLEND, BehaviorOutput, Phase, World
from numpy.typing import NDArray

from fbql_fusion.core.controllers import Selection, Transition
from fbql_fusion.core.experience import Episode
from fbql_fusion.core.features import Features, Resolution, Scales, Situation
from fbql_fusion.core.joint_state import JointState
from fbql_fusion.core.parameters import FusionParameters
from fbql_fusion.core.policy_arrays import check_arrays
from fbql_fusion.core.world_tiles import FAR, told_of

FIRST_EPISODES = 20
"""Episodes that the scales are made of where none is guided."""
_FIRST_BATCH = 2
_BATCH_GROWTH = 20
"""Episodes after which a batch has one episode more."""

Judgement = tuple[tuple[float, ...], tuple[float, ...]]
"""(weights, q) of a situation, each of length n; q is empty where nothing but weights is learned."""


class Holding(NamedTuple):
    """How is played."""

    steps: int
    """A decision is held for so many steps while it learns."""
    play_steps: int
    """The same where nothing is learned."""
    play: str
    """One of `fbql_parameters.PLAYS`: how is played when nothing is learned."""
    patience: int
    """Decisions in the same joint state, in one episode, after which one is drawn there; 0: never."""
    discount: float
    """gamma, per step."""
    batch_episodes: int
    """Episodes learned from at a time, later on."""
    world_tilings: int
    """Tilings of the world state that a critic goes by, see `Resolution`."""


class HeldDecisions(ABC):
    """Decides every few steps who drives, and remembers what came of it."""

    def __init__(self, parameters: FusionParameters, holding: Holding, generator: np.random.Generator) -> None:
        self._parameters = parameters
        self._holding = holding
        self._generator = generator
        self._behaviors = n = len(parameters.behaviors)
        self._resolution = Resolution(
            parameters.fbql_leaf_pairs,
            parameters.fbql_pair_tilings,
            parameters.fbql_pair_tiles,
            parameters.fbql_joint_tilings,
            parameters.fbql_joint_tiles,
            holding.world_tilings,
            parameters.fbql_mirror,
        )
        self._alone = tuple(tuple(1.0 if i == driver else 0.0 for i in range(n)) for driver in range(n))
        self._features: Features | None = None
        self._lengths: tuple[int, ...] | None = None
        """How many numbers each behavior senses, length n, once it is known."""
        self._episodes: int = 0
        """Episodes that were learned from, but for the guided ones."""
        self._waiting: list[Episode] = []
        """Ended episodes that were not learned from yet."""

        self._phase = Phase.EVALUATION
        self._episode: Episode | None = None
        """The episode under way; None where nothing is, or can be, learned from it."""
        self._linked = False
        """Whether a transition led to the world state that is selected for next."""
        self._held_for = 0
        self._weights: tuple[float, ...] = (1.0 / n,) * n
        self._learned: tuple[float, ...] = self._weights
        """Those by which was decided."""
        self._driver = DRIVER_BLEND
        self._q: tuple[float, ...] = ()
        self._visits: dict[JointState, int] = {}

    def __len__(self) -> int:
        """Number of features met so far."""
        return 0 if self._features is None else len(self._features)

    @abstractmethod
    def _judge(self, active: Sequence[int]) -> Judgement:
        """Weights and Q of a situation with these active features; none are known yet where it is empty."""

    @abstractmethod
    def _learn_first(self) -> None:
        """Learns from the first episodes, which wait. Their features were just made."""

    @abstractmethod
    def _learn_waiting(self) -> None:
        """An episode more waits: learns from those that wait, if it is time to."""

    def begin_episode(self, phase: Phase) -> None:
        """A new episode. What was not ended before is not learned from."""
        self._phase = phase
        if self._features is None and self._waiting and phase is not Phase.GUIDED:
            guided = self._waiting[0].guided
            if guided or len(self._waiting) >= FIRST_EPISODES or phase is Phase.EVALUATION:
                self._look_back()
        learns = self._parameters.learn and phase is not Phase.EVALUATION
        self._episode = Episode(guided=phase is Phase.GUIDED) if learns else None
        self._linked = True
        self._held_for = 0
        self._visits.clear()

    def select(self, world: World, joint_state: JointState, outputs: Sequence[BehaviorOutput | None]) -> Selection:
        """The held behavior alone, or, when its steps are over, the one that is decided on now."""
        complete = None not in outputs
        if self._episode is not None and not (self._linked and complete):
            self._episode = None  # something is missing: the rest of it can't be told what it led to
        self._linked = False
        if self._held_for and complete and not world.ended:
            self._held_for -= 1
            if self._driver == DRIVER_BLEND:
                self._weights, self._q = self._judge(self._known(self._situation(world, joint_state, outputs)))
                self._learned = self._weights
            return self._weights, self._driver, self._q, self._learned
        situation = self._situation(world, joint_state, outputs)
        if self._episode is not None and not self._is_sound(situation):
            self._episode = None
        if world.ended:
            if self._episode is not None:
                self._end(self._episode, situation)
            return self._weights, self._driver, self._q, self._learned
        self._decide(situation, outputs)
        steps = self._holding.play_steps if self._phase is Phase.EVALUATION else self._holding.steps
        self._held_for = steps - 1 if complete else 0
        return self._weights, self._driver, self._q, self._learned

    def _situation(self, world: World, joint_state: JointState, outputs: Sequence[BehaviorOutput | None]) -> Situation:
        """What is known of a step. The world state is told only where it is learned from."""
        observed = tuple([() if x is None else x.observation for x in outputs])
        if self._episode is None or not self._resolution.world_tilings:
            return Situation(joint_state, observed)
        return Situation(joint_state, observed, told_of(world, self._resolution.mirror))

    def _is_sound(self, situation: Situation) -> bool:
        """Whether all numbers are finite, and as many are sensed as ever, and nothing is out of this world: else it can't be
        learned from."""
        lengths = tuple([len(observed) for observed in situation.observed])
        if self._lengths is None:
            self._lengths = lengths
        told = situation.told
        sound = lengths == self._lengths and isfinite(sum(map(sum, situation.observed)) + sum(told))
        return sound and (not told or (max(told) < FAR and min(told) > -FAR))

    def _known(self, situation: Situation) -> Sequence[int]:
        """The active features that were met before."""
        return () if self._features is None else self._features.known(situation)

    def _decide(self, situation: Situation, outputs: Sequence[BehaviorOutput | None]) -> None:
        """Who drives for the next steps."""
        episode = self._episode
        features = self._features
        row = features.row(situation) if features is not None and episode is not None else None
        active = self._known(situation) if features is None or row is None else features.active_in(row)
        weights, self._q = self._judge(active)
        self._learned = weights
        live = [w if x is not None else 0.0 for w, x in zip(weights, outputs, strict=True)]
        joint_state = situation.joint_state
        visits = self._visits[joint_state] = self._visits.get(joint_state, 0) + 1
        patience = self._holding.patience
        play = "drawn" if self._phase is not Phase.EVALUATION else self._holding.play
        if 0 < patience < visits and self._phase is Phase.EVALUATION:
            # The longer it goes on, the more alike the weights by which is drawn: no deadlock lasts.
            play, live = "drawn", [w ** (patience / visits) for w in live]
        if play == "blended" or not any(live):
            self._weights, self._driver = weights, DRIVER_BLEND
            return
        driver = self._drawn(live) if play == "drawn" else live.index(max(live))
        self._weights, self._driver = self._alone[driver], driver
        if episode is not None:
            episode.begin_decision(situation, row, driver, weights[driver])

    def _drawn(self, weights: Sequence[float]) -> int:
        """One of the behaviors, by its weight."""
        left = self._generator.random() * sum(weights)
        for driver, weight in enumerate(weights):
            left -= weight
            if left < 0.0:
                return driver
        return max(driver for driver, weight in enumerate(weights) if weight)

    def learn(self, transition: Transition) -> None:
        """Adds a step to the decision under way. What was decided is learned from when its episode has ended."""
        self._linked = True
        if self._episode is None:
            return
        if not self._episode.add_step(transition.driver, transition.reward, self._holding.discount):
            self._episode = None
        elif transition.terminated:
            self._episode.terminated = True

    def _end(self, episode: Episode, situation: Situation) -> None:
        """The episode is whole: `situation` is what it ended in."""
        self._episode = None
        if not episode.drivers:
            return
        episode.end(situation, None if self._features is None else self._features.row(situation))
        self._waiting.append(episode)
        if not episode.guided:
            self._episodes += 1
        if self._features is not None:
            self._learn_waiting()

    def _is_batch(self) -> bool:
        """Whether enough episodes wait. A batch begins with few: the first ones are long and there is most to be learned."""
        return len(self._waiting) >= min(self._holding.batch_episodes, _FIRST_BATCH + self._episodes / _BATCH_GROWTH)

    def _look_back(self) -> None:
        """After the first episodes: makes the scales of what was sensed in them, and learns from them."""
        situations = [situation for episode in self._waiting for situation in episode.situations]
        scales = Scales.of(situations, self._resolution.mirror)
        offsets = Features.random_offsets(self._resolution, len(scales.knots), self._generator)
        self._features = features = Features(scales, self._resolution, offsets)
        for episode in self._waiting:
            episode.rows = [features.row(situation) for situation in episode.situations]
            episode.situations = []
        self._learn_first()

    def _load_features(self, arrays: Mapping[str, NDArray[Any]], columns: Mapping[str, tuple[int, ...]]) -> Features:
        """Takes over the features, and checks the learner's tables, which have a row for each of them.

        Args:
            arrays: as `to_arrays` gave them.
            columns: the shape of a row of each table of floats.

        Returns:
            The features. Raises BadInput.
        """
        features = Features.from_arrays(arrays, self._resolution, self._behaviors)
        m = len(features)
        check_arrays(arrays, {name: ("f", (m, *row)) for name, row in columns.items()})
        self._features, self._lengths = features, features.scales.lengths
        return features
