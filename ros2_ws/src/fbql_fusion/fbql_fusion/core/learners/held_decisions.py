"""Shared by the learners that hold their decisions: features, the trajectory in progress, and how a decision is made.

A decision is an option (Sutton, Precup & Singh 1999): one behavior drives for several steps, so that the learning
problem is a semi-Markov decision process. What a decision is worth, and how that is learned, is up to the learner:
`Fbql` (PPO) or `FbqlValue` (action values).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from math import isfinite
from typing import Any, NamedTuple

import numpy as np
from fbql_common.core.command_space import Command
from fbql_common.core.errors import BadInput
from fbql_common.core.kernels import prepare
from fbql_common.core.types import DRIVER_BLEND, Phase
from numpy.typing import NDArray

from fbql_fusion.core.controllers.interface import JointState, Selection, Transition, one_hot_weights
from fbql_fusion.core.learners import trajectories
from fbql_fusion.core.learners.features import Features, Resolution, Scales, Situation
from fbql_fusion.core.learners.linear import CAPACITY, Floats, grow_table, padded
from fbql_fusion.core.learners.parameters import FeatureParameters
from fbql_fusion.core.learners.policy_arrays import check_arrays, generator_state, set_generator_state
from fbql_fusion.core.learners.tilings import FAR, critic_tilings
from fbql_fusion.core.learners.trajectories import Trajectory
from fbql_fusion.core.tasks.interface import Answer, Answers, Guide, Task

FIRST_EPISODES = 20
"""Episodes that the scales are made of if none is guided."""
_FIRST_BATCH = 2
_BATCH_GROWTH = 20
"""Number of episodes after which a batch grows by one episode."""
COMPILE_AFTER = 10_000
"""Decisions of this process, about 40,000 steps, after which it pays to compile the learning code."""
_ALWAYS = {"counts": ("i", (2,)), "generator": ("u", (6,))}
"""Kind and shape of the arrays that every policy has."""

Values = tuple[tuple[float, ...], tuple[float, ...]]
"""(weights, q) of a situation, each of length n; q is empty if only weights are learned."""


def per_step(discount: float, period_s: float, task: Task[Any, Any, Any]) -> float:
    """The discount over a step of a task, from one over a period [s]."""
    return discount ** (task.period_s / period_s)


def _steps_in(duration_s: float, task: Task[Any, Any, Any]) -> int:
    return max(round(duration_s / task.period_s), 1)


class Holding(NamedTuple):
    """How long a decision is held, and how it is made."""

    steps: int
    """Steps for which a decision is held while learning."""
    play_steps: int
    """The same while not learning."""
    play: str
    """One of `parameters.PLAYS`: how a decision is made while not learning."""
    patience: int
    """Decisions in the same joint state, in one episode, after which the driver is drawn there; 0: never."""
    discount: float
    """gamma, per step."""
    batch_episodes: int
    """Episodes in a batch, once it has grown to its full size."""
    world_tilings: int
    """Tilings of each group of the inputs that only the critic sees, see `Resolution`."""
    has_prior: bool
    """Whether the guide's choice is a feature."""

    @classmethod
    def of(
        cls,
        task: Task[Any, Any, Any],
        durations_s: tuple[float, float],
        play: str,
        patience: int,
        discount: float,
        batch_episodes: int,
        world_tilings: int,
        has_prior: bool = False,
    ) -> Holding:
        """The same from durations, while learning and while not, that are rounded to whole steps of the task."""
        steps, play_steps = (_steps_in(each, task) for each in durations_s)
        return cls(steps, play_steps, play, patience, discount, batch_episodes, world_tilings, has_prior)


def _may_drive(answer: Answer | None) -> bool:
    return answer is not None and answer.active


def _mask_of(answers: Answers) -> tuple[bool, ...] | None:
    """Which behaviors may drive; None where that is no restriction: all may, or none. One that did not answer is not
    masked: what was learned about it is reported all the same, and it is not drawn."""
    mask = tuple([x is None or x.active for x in answers])
    return None if all(mask) or not any(mask) else mask


class HeldDecisions(ABC):
    """Decides every few steps which behavior drives, and collects the outcomes."""

    def __init__(
        self,
        parameters: FeatureParameters,
        holding: Holding,
        task: Task[Any, Any, Any],
        guide: Guide,
        generator: np.random.Generator,
    ) -> None:
        self._parameters = parameters
        self._holding = holding
        self._task = task
        self._guide = guide
        self._critic = critic_tilings(task.critic_widths, holding.world_tilings)
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
        self._alone = one_hot_weights(n)
        self._features: Features | None = None
        self._lengths: tuple[int, ...] | None = task.observed_lengths
        """How many numbers each group of observations has, once it is known."""
        self._everyone = (True,) * n
        self._episodes: int = 0
        """Episodes that ended, guided ones not counted."""
        self._updates: int = 0
        self._decisions = 0
        """Decisions that this process has learned from."""
        self._waiting: list[Trajectory] = []
        """Ended episodes that have not been learned from yet."""

        self._phase = Phase.EVALUATION
        self._explores = False
        """Whether the decisions of this episode are drawn and held as while learning, else as `Holding.play`."""
        self._trajectory: Trajectory | None = None
        """The trajectory of the episode in progress; None if nothing is, or can be, learned from it."""
        self._linked = False
        """Whether a transition led to the moment that is decided next."""
        self._held_for = 0
        self._nobody = False
        """Whether no behavior could drive when it was last decided."""
        self._weights: tuple[float, ...] = (1.0 / n,) * n
        self._learned: tuple[float, ...] = self._weights
        """The weights by which the last decision was made."""
        self._driver = DRIVER_BLEND
        self._q: tuple[float, ...] = ()
        self._visits: dict[JointState, int] = {}
        self.known_draw: int | None = None
        """See `Drawing`."""
        self.draws_taken: int = 0

    def __len__(self) -> int:
        """Number of features met so far."""
        return 0 if self._features is None else len(self._features)

    @abstractmethod
    def _evaluate(self, active: Sequence[int], situation: Situation) -> Values:
        """Weights and Q of a situation with these active features; empty means that none is known yet. Where the situation has a
        mask, weights are those among the behaviors that may drive."""

    def _set_prior(self, features: Features) -> None:
        """Sets the preference for the guide's choice before anything is learned, if that is a feature."""
        raise NotImplementedError

    @abstractmethod
    def _learn_first(self) -> None:
        """Learns from the first trajectories, in `_waiting`. Their features have just been made."""

    @abstractmethod
    def _learn_waiting(self) -> None:
        """Called after a trajectory was added to `_waiting`: learns from those waiting if a batch is complete."""

    @abstractmethod
    def _tables(self) -> dict[str, Floats]:
        """The learned tables, one row per feature, by their names in a policy."""

    @abstractmethod
    def _set_tables(self, tables: Mapping[str, Floats]) -> None:
        """Replaces them."""

    def begin_episode(self, phase: Phase) -> None:
        """Begins a new episode. An unfinished one is not learned from."""
        self._phase = phase
        self._explores = phase is not Phase.EVALUATION
        if self._can_make_features(phase):
            self._make_features()
        learns = self._parameters.learn and phase is not Phase.EVALUATION
        self._trajectory = Trajectory(guided=phase is Phase.GUIDED) if learns else None
        self._linked = True
        self._nobody = False
        self._held_for = 0
        self._visits.clear()

    def select(self, moment: Any, joint_state: JointState, answers: Answers) -> Selection:
        """The behavior that is being held, or a newly chosen one once its steps are over; it drives alone."""
        complete = None not in answers
        if self._trajectory is not None and not (self._linked and complete):
            self._trajectory = None  # a step or an answer is missing: what a decision led to is not known
        self._linked = False
        driven = answers[self._driver] if self._driver >= 0 else None
        if self._held_for and complete and not moment.ended and (driven is None or driven.active):
            self._held_for -= 1
            if self._driver == DRIVER_BLEND:
                situation = self._situation(moment, joint_state, answers)
                self._weights, self._q = self._evaluate(self._known(situation), situation)
                self._learned = self._weights
            return self._weights, self._driver, self._q, self._learned
        situation = self._situation(moment, joint_state, answers)
        if self._trajectory is not None and not self._is_sound(situation):
            self._trajectory = None
        if moment.ended:
            if self._trajectory is not None:
                self._end(self._trajectory, situation)
            return self._weights, self._driver, self._q, self._learned
        self._decide(situation, answers)
        steps = self._holding.steps if self._explores else self._holding.play_steps
        self._held_for = steps - 1 if complete and not self._nobody else 0
        return self._weights, self._driver, self._q, self._learned

    def _situation(self, moment: Any, joint_state: JointState, answers: Answers) -> Situation:
        """The situation of a step; the critic's further inputs are added if it is learned from."""
        task = self._task
        is_seen = self._trajectory is not None and len(self._critic.sizes)
        has_prior = self._holding.has_prior if self._features is None else self._features.has_guide
        return Situation(
            joint_state,
            task.observed(moment, answers),
            task.critic_inputs(moment, self._resolution.mirror) if is_seen else (),
            _mask_of(answers),
            self._guide.driver(moment, answers) if has_prior else None,
        )

    def _is_sound(self, situation: Situation) -> bool:
        """Whether it can be learned from: every number is finite, each group has as many values as before, and
        the critic's inputs are within FAR."""
        lengths = tuple([len(observed) for observed in situation.observed])
        if self._lengths is None:
            self._lengths = lengths
        inputs = situation.critic_inputs
        sound = lengths == self._lengths and isfinite(sum(map(sum, situation.observed)) + sum(inputs))
        return sound and (not inputs or (max(inputs) < FAR and min(inputs) > -FAR))

    def _known(self, situation: Situation) -> Sequence[int]:
        """The active features that were met before."""
        return () if self._features is None else self._features.known(situation)

    def _decide(self, situation: Situation, answers: Answers) -> None:
        """Decides which behavior drives for the next steps."""
        trajectory = self._trajectory
        features = self._features
        row = features.row(situation) if features is not None and trajectory is not None else None
        active = self._known(situation) if features is None or row is None else features.active_in(row)
        weights, self._q = self._evaluate(active, situation)
        self._learned = weights
        live = [w if _may_drive(x) else 0.0 for w, x in zip(weights, answers, strict=True)]
        joint_state = situation.joint_state
        visits = self._visits[joint_state] = self._visits.get(joint_state, 0) + 1
        patience = self._holding.patience
        play = "drawn" if self._explores else self._holding.play
        if 0 < patience < visits and not self._explores:
            # The weights for the draw become more equal with every repetition: no deadlock lasts.
            play, live = "drawn", [w ** (patience / visits) for w in live]
        self._nobody = not any(live)
        if play == "blended" or self._nobody:
            self._weights, self._driver = weights, DRIVER_BLEND
            return
        driver = self._draw(live) if play == "drawn" else live.index(max(live))
        self._weights, self._driver = self._alone[driver], driver
        if trajectory is not None:
            trajectory.begin_decision(situation, row, self._mask(situation), driver, weights[driver])

    def _mask(self, situation: Situation) -> tuple[bool, ...]:
        return situation.mask or self._everyone

    def _draw(self, weights: Sequence[float]) -> int:
        """Draws a behavior with the weights as probabilities."""
        known = self.known_draw
        if known is not None and 0 <= known < len(weights) and weights[known] > 0.0:
            self.draws_taken += 1
            return known
        left = self._generator.random() * sum(weights)
        for driver, weight in enumerate(weights):
            left -= weight
            if left < 0.0:
                return driver
        return max(driver for driver, weight in enumerate(weights) if weight)

    def learn(self, transition: Transition) -> None:
        """Adds a step to the current decision, which is learned from when its episode has ended."""
        self._linked = True
        if self._trajectory is None:
            return
        if self._nobody and transition.driver < 0:
            self._trajectory.wait(transition.reward, self._holding.discount)
        elif not self._trajectory.add_step(transition.driver, transition.reward, self._holding.discount):
            self._trajectory = None
            return
        if transition.terminated:
            self._trajectory.terminated = True
            self._trajectory.succeeded = transition.succeeded

    @property
    def held_driver(self) -> int:
        """See `controllers.interface.Holding`."""
        return self._driver if self._held_for else DRIVER_BLEND

    def hold(self, moment: Any, transition: tuple[float, Command] | None) -> None:
        """See `controllers.interface.Holding`."""
        self._held_for -= 1
        trajectory = self._trajectory
        if trajectory is not None and (
            transition is None or not trajectory.add_step(self._driver, transition[0], self._holding.discount)
        ):
            self._trajectory = None
        self._linked = False

    def _end(self, trajectory: Trajectory, situation: Situation) -> None:
        """Completes the episode, which ended in `situation`."""
        self._trajectory = None
        if not trajectory.drivers:
            return
        row = None if self._features is None else self._features.row(situation)
        trajectory.end(situation, row, self._mask(situation))
        self._waiting.append(trajectory)
        self._decisions += len(trajectory.drivers)
        if self._decisions >= COMPILE_AFTER:
            prepare()
        if not trajectory.guided:
            self._episodes += 1
        if self._features is not None:
            self._learn_waiting()

    def _is_batch(self) -> bool:
        """Whether enough episodes are waiting. The first batches are small: early episodes are long and teach the
        most."""
        return len(self._waiting) >= min(self._holding.batch_episodes, _FIRST_BATCH + self._episodes / _BATCH_GROWTH)

    def _can_make_features(self, phase: Phase) -> bool:
        """Whether an episode of this phase is the first one for which there are to be features."""
        if self._features is not None or not self._waiting or phase is Phase.GUIDED:
            return False
        return self._waiting[0].guided or len(self._waiting) >= FIRST_EPISODES or phase is Phase.EVALUATION

    def _make_features(self) -> None:
        """After the first episodes: makes scales and features from the values sensed in them, and learns from them."""
        situations = [situation for trajectory in self._waiting for situation in trajectory.situations]
        scales = Scales.of(situations, self._resolution.mirror)
        offsets = Features.random_offsets(self._resolution, len(scales.knots), self._generator)
        behaviors, has_guide = self._behaviors, self._holding.has_prior
        self._features = features = Features(scales, self._resolution, offsets, self._critic, behaviors, has_guide)
        if has_guide:
            self._set_prior(features)
        for trajectory in self._waiting:
            trajectory.rows = [features.row(situation) for situation in trajectory.situations]
            trajectory.situations = []
        self._learn_first()

    def to_arrays(self) -> dict[str, NDArray[Any]]:
        """Everything learned, and the state needed to continue exactly: the generator and the waiting episodes.

        counts int64 [2] (episodes, updates), generator uint64 [6], the learner's tables float64 [m, ...] (m features); of
        the features see `Features.to_arrays`, of the episodes `trajectories`. As long as there are no features, only counts
        and generator are there: the first episodes, guided or not, are not kept.
        """
        arrays: dict[str, NDArray[Any]] = {
            "counts": np.array([self._episodes, self._updates], dtype=np.int64),
            "generator": generator_state(self._generator),
        }
        if self._features is None:
            return arrays
        self._grow_tables()
        m = len(self)
        arrays |= {name: table[:m].copy() for name, table in self._tables().items()}
        return arrays | self._features.to_arrays() | trajectories.to_arrays(self._waiting)

    def load_arrays(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Restores what `to_arrays` returned. Raises BadInput for arrays that can't come from it."""
        check_arrays(arrays, _ALWAYS)
        counts: list[int] = arrays["counts"].tolist()
        self._episodes, self._updates = counts
        if not self._can_be_counts():
            raise BadInput(f"the policy's array 'counts' is {counts}, which is impossible")
        set_generator_state(self._generator, arrays["generator"])
        if arrays.keys() > _ALWAYS.keys() or self._updates:
            features = Features.from_arrays(
                arrays, self._resolution, self._behaviors, self._critic, self._task.observed_lengths
            )
            m = len(features)
            shapes = {name: ("f", (m, *table.shape[1:])) for name, table in self._tables().items()}
            check_arrays(arrays, shapes)
            self._waiting = trajectories.from_arrays(arrays, features, self._behaviors)
            self._features, self._lengths = features, features.scales.lengths
            self._set_tables({name: padded(arrays[name], max(m, CAPACITY)) for name in shapes})

    def _can_be_counts(self) -> bool:
        return min(self._episodes, self._updates) >= 0

    def _grow_tables(self) -> None:
        """Adds rows for features met since the last call."""
        self._set_tables({name: grow_table(table, len(self)) for name, table in self._tables().items()})
