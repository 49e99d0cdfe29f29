"""What `fbql` has, for learners with networks of their own: its choice, senses and mirror, and what its critic knows.

Each part can be left out, so that a study can say what it is worth.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
from fbql_behaviors.core.behavior import Behavior
from fbql_common.core.types import World
from fbql_fusion.core.tasks.soccer.critic import CRITIC_INPUTS, critic_inputs
from fbql_sim.gymnasium_env import Drive
from numpy.typing import NDArray

from fbql_studies.peers.senses import Senses
from fbql_studies.peers.team_env import BlendEnv, chosen

FAR = 20.0
"""Largest absolute value of what only the critic sees [m, m/s]."""


class ChoiceEnv(BlendEnv):
    """The action is the behavior that drives alone, held while its answers change.

    Action: 0 .. n - 1; without `selects`, the weights of BlendEnv as logits.
    Observation: float32, what fbql's weights see (each behavior's observation and leaf, see `Senses`), then, if `informed`,
    what only fbql's critic sees (`fbql_fusion.core.tasks.soccer.critic`). `critic_only` says how many these are.

    Args:
        selects: whether one behavior drives alone.
        mirrors: whether situations that mirror each other look alike.
        informed: whether the critic's further inputs are seen.
    """

    def __init__(
        self,
        behaviors: Sequence[Behavior] | None = None,
        *,
        selects: bool = True,
        mirrors: bool = True,
        informed: bool = True,
        **parameters: Any,
    ) -> None:
        super().__init__(behaviors, **parameters)
        self._selects, self._mirrors = selects, mirrors
        self.critic_only = CRITIC_INPUTS if informed else 0
        self._senses = Senses(self.behaviors, references=False, mirror=mirrors)
        high = np.ones(self._senses.width + self.critic_only, np.float32)
        high[self._senses.width :] = FAR
        self.observation_space = gymnasium.spaces.Box(-high, high, dtype=np.float32)
        if selects:
            self.action_space = gymnasium.spaces.Discrete(len(self.behaviors))

    def driver(self, action: Any) -> Drive:
        """Drives by the answers of one behavior, or by weights. Raises ValueError for another action."""
        if not self._selects:
            return super().driver(action)
        answer = self._answers[chosen(action, len(self.behaviors))]

        def drive(world: World) -> tuple[float, float]:
            output = answer(world)
            return output.left_rad_s, output.right_rad_s

        return drive

    def observe(self, world: World) -> NDArray[np.float32]:
        """What the behaviors sense, then what only the critic sees."""
        seen = super().observe(world)
        if not self.critic_only:
            return seen
        inputs = np.array(critic_inputs(world, self._mirrors), np.float32)
        return np.concatenate((seen, np.clip(inputs, -FAR, FAR)))
