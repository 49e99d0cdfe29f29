"""The learner `fbql_model`: the update of `fbql`, eqs. 10 to 15, in episodes that a learned model imagines.

This is Dyna (Sutton 1990, Integrated Architectures for Learning, Planning, and Reacting): a model of the task is fitted
to the real steps so far, the learner is trained in it, and the trained policy plays in reality. Real episodes teach only the
model, so in reality the largest weight drives, without exploration.

- After the guided episodes: the warm start of `fbql`, then many imagined episodes (`fbql_model_first_episodes`).
- After every `fbql_model_refit_episodes` real episodes: a new model of all data, and more imagined episodes.
- Always between two episodes. The learner knows neither the task nor the model: see `tasks.interface.Imagination`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from fbql_common.core.command_space import Command
from fbql_common.core.errors import BadInput
from fbql_common.core.kernels import prepare
from fbql_common.core.types import Phase
from numpy.typing import NDArray

from fbql_fusion.core.controllers.interface import JointState, Selection, Transition
from fbql_fusion.core.learners.dyna.parameters import FbqlModelParameters
from fbql_fusion.core.learners.policy_arrays import check_arrays, generator_state, set_generator_state
from fbql_fusion.core.learners.ppo.learner import Ppo, batch_of_imagined, holding_of
from fbql_fusion.core.tasks.interface import Answers, Guide, Imagination, Task

_NEVER = -1
_OWN = {"imagined_at": ("i", (1,)), "imagination_generator": ("u", (6,))}
"""Kind and shape of the arrays that its policies have in addition to those of `Ppo` and of the imagination."""


class FbqlModel(Ppo):
    """Dyna (see the module).

    Args:
        imagination: keeps the real steps, and plays imagined episodes.
        generator: of the real decisions; what is imagined has a generator of its own, which is spawned from it.
    """

    kind = "fbql_model"

    def __init__(
        self,
        parameters: FbqlModelParameters,
        task: Task[Any, Any, Any],
        guide: Guide,
        imagination: Imagination,
        generator: np.random.Generator,
    ) -> None:
        durations_s = parameters.fbql_model_hold_s, parameters.fbql_model_play_s
        holding = holding_of(parameters, durations_s, parameters.fbql_model_batch_episodes, task)
        super().__init__(parameters, holding, parameters.fbql_model_passes, 0.0, task, guide, generator)
        self._own = parameters
        self._imagination = imagination
        self._imagination_generator = generator.spawn(1)[0]
        self._imagined_at = _NEVER
        """Real episodes, guided ones not counted, when it imagined last."""
        self._is_kept = False
        """Whether the steps of this episode are data."""
        self._has_begun = False
        """Whether its first moment was seen."""
        self._command: Command | None = None
        """The command that led to the moment that is decided next; None if unknown."""

    def begin_episode(self, phase: Phase) -> None:
        """See `Controller`."""
        super().begin_episode(phase)
        self._explores = phase is Phase.GUIDED or (phase is Phase.LEARNING and self._imagined_at == _NEVER)
        self._imagination.forget_episode()
        learns = self._parameters.learn and phase is not Phase.EVALUATION
        self._is_kept = learns and (phase is Phase.GUIDED or self._own.fbql_model_data == "all")
        self._has_begun = False
        self._command = None

    def select(self, moment: Any, joint_state: JointState, answers: Answers) -> Selection:
        """See `Controller`."""
        if self._is_kept:
            self._keep(moment, answers)
        return super().select(moment, joint_state, answers)

    def learn(self, transition: Transition) -> None:
        """Remembers what was commanded; see `HeldDecisions`."""
        super().learn(transition)
        self._command = transition.command

    def hold(self, moment: Any, transition: tuple[float, Command] | None) -> None:
        """See `controllers.interface.Holding`."""
        if transition is not None:
            _, self._command = transition
        if self._is_kept:
            self._keep(moment, ())
        super().hold(moment, transition)

    def _keep(self, moment: Any, answers: Answers) -> None:
        """Adds the step that led to a moment to the data; an unknown step ends the data of this episode."""
        if not self._has_begun:
            self._has_begun = True
            self._check_trees(answers)
            self._imagination.begin(moment)
        elif self._command is not None:
            self._imagination.add(self._command, moment)
        else:
            self._imagination.forget_episode()
            self._is_kept = False
        self._command = None

    def _check_trees(self, answers: Answers) -> None:
        """Raises BadInput if a behavior answers with another tree than it would have in imagined episodes."""
        for name, expected, answer in zip(
            self._parameters.behaviors, self._imagination.tree_hashes, answers, strict=True
        ):
            if answer is not None and answer.tree_hash != expected:
                raise BadInput(
                    f"the tree of {name} that fbql_model would imagine with (SHA-256 {expected[:12]}) is not the one that "
                    f"answers ({answer.tree_hash[:12]}); give it the trees that play"
                )

    def is_due(self, phase: Phase) -> bool:
        """See `Reflecting`."""
        if phase is Phase.GUIDED or not (self._features is not None or self._can_make_features(phase)):
            return False
        every = self._own.fbql_model_refit_episodes
        return self._imagined_at == _NEVER or 0 < every <= self._episodes - self._imagined_at

    def reflect(self) -> None:
        """Fits the model and learns in it. See `Reflecting`."""
        if self._features is None:
            self._make_features()
        is_first = self._imagined_at == _NEVER
        self._imagine(self._own.fbql_model_first_episodes if is_first else self._own.fbql_model_episodes)

    def _imagine(self, episodes: int) -> None:
        """Fits the model to all real steps, then plays and learns, a batch at a time."""
        hold, trace, generator = self._holding, self._ppo.fbql_trace, self._imagination_generator
        prepare()
        assert self._features is not None
        if not self._imagination.fit(self._features, generator):
            return
        left = episodes
        while left > 0:
            batch = min(left, hold.batch_episodes)
            found = self._imagination.play(self._theta, batch, hold.steps, hold.discount, generator)
            self._grow_tables()
            active = self._features.active_features
            self._improve(batch_of_imagined(found, self._value, trace, active, self._behaviors), generator)
            left -= batch
        self._imagined_at = self._episodes

    def _learn_first(self) -> None:
        if self._waiting[0].guided:
            super()._learn_first()
        self._waiting = []

    def _learn_waiting(self) -> None:
        if self._waiting[-1].guided:
            super()._learn_waiting()
        self._waiting = []  # a real episode teaches only the model

    def to_arrays(self) -> dict[str, NDArray[Any]]:
        """What `HeldDecisions.to_arrays` returns, imagined_at int64 [1] (episodes when it imagined last),
        imagination_generator uint64 [6], and the real steps (`Imagination.to_arrays`)."""
        return {
            **super().to_arrays(),
            "imagined_at": np.array([self._imagined_at], dtype=np.int64),
            "imagination_generator": generator_state(self._imagination_generator),
            **self._imagination.to_arrays(),
        }

    def load_arrays(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Restores what `to_arrays` returned. Raises BadInput for arrays that can't come from it."""
        check_arrays(arrays, _OWN)
        own = {*_OWN, *self._imagination.to_arrays()}
        super().load_arrays({name: array for name, array in arrays.items() if name not in own})
        (self._imagined_at,) = arrays["imagined_at"].tolist()
        if not _NEVER <= self._imagined_at <= self._episodes:
            raise BadInput(f"the policy's array 'imagined_at' is {self._imagined_at}, which is impossible")
        set_generator_state(self._imagination_generator, arrays["imagination_generator"])
        self._imagination.load_arrays(arrays)
