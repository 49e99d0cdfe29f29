"""The behaviors in front of a learner: Gymnasium environments whose action determines how the behaviors are fused.

    import gymnasium
    import fbql_studies.peers.team_env  # registers the environments

    env = gymnasium.make("fbql/Blend-v0", hold_steps=10)

They are `fbql_sim.gymnasium_env.WheelsEnv` with another action and observation: reward, ends, seeds and parameters are the
same. They see what the behaviors sense, and nothing else of the field.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import exp
from typing import Any

import gymnasium
import numpy as np
from fbql_behaviors.core.behavior import Behavior
from fbql_behaviors.shipped import shipped_trees
from fbql_behaviors.storage import load_tree
from fbql_common.core.errors import BadInput
from fbql_common.core.field import WHEELS
from fbql_common.core.types import BehaviorOutput, World
from fbql_fusion.core.blending import blend
from fbql_fusion.core.parameters import FusionParameters
from fbql_sim.gymnasium_env import Drive, WheelsEnv, numbers_of
from numpy.typing import NDArray

from fbql_studies.peers.senses import Senses

BLEND_ID, SELECTION_ID = "fbql/Blend-v0", "fbql/Selection-v0"
SHARPNESS = 4.0
"""Factor from an action in -1 .. 1 to a logit: one behavior can weigh exp(2 * 4) = 2981 times as much as another."""
ACTIONS = ("logits", "weights")


class TeamEnv(WheelsEnv):
    """Behaviors that answer every world.

    Args:
        behaviors: those that are fused, in order; the shipped ones unless given.
        parameters: those of WheelsEnv.
    """

    def __init__(self, behaviors: Sequence[Behavior] | None = None, **parameters: Any) -> None:
        super().__init__(**parameters)
        self.behaviors = tuple(shipped_behaviors() if behaviors is None else behaviors)
        self._answers = [behavior.answer for behavior in self.behaviors]
        self._heard: tuple[World | None, list[BehaviorOutput]] = None, []

    def hear(self, world: World) -> list[BehaviorOutput]:
        """The behaviors' answers to a world. They are computed once, even if the world is first observed and then
        acted on."""
        if self._heard[0] is not world:
            self._heard = world, [answer(world) for answer in self._answers]
        return self._heard[1]

    def blended(self, weights: Sequence[float]) -> Drive:
        """Drives by the weighted sum of the behaviors' answers to each world."""

        def drive(world: World) -> tuple[float, float]:
            left, right = blend(weights, self.hear(world), WHEELS).command
            return left, right

        return drive


class BlendEnv(TeamEnv):
    """The action is the weights of the n behaviors, held while their answers change.

    Action: float32 [n]. `logits`: in -1 .. 1, weights = softmax(SHARPNESS * action). `weights`: in 0 .. 1, divided by their
    sum; all 0 weigh the same.
    Observation: float32, see `Senses`.

    Raises BadInput for an unknown kind of action.
    """

    def __init__(self, behaviors: Sequence[Behavior] | None = None, action: str = "logits", **parameters: Any) -> None:
        if action not in ACTIONS:
            raise BadInput(f"environment: parameter 'action' is {action!r}; choose one of: {', '.join(ACTIONS)}")
        super().__init__(behaviors, **parameters)
        self._logits = action == "logits"
        self.action_space = gymnasium.spaces.Box(-1.0 if self._logits else 0.0, 1.0, (len(self.behaviors),), np.float32)
        self._senses = Senses(self.behaviors, references=True, mirror=False)
        self.observation_space = gymnasium.spaces.Box(-1.0, 1.0, (self._senses.width,), np.float32)

    def driver(self, action: Any) -> Drive:
        """Drives by the weights that the action stands for."""
        return self.blended(self.weights(action))

    def weights(self, action: Any) -> list[float]:
        """The weights that an action stands for: n, sum 1. Raises ValueError if it is not n finite numbers."""
        numbers = np.array(numbers_of(action, len(self.behaviors)), np.float64)
        limited = np.clip(numbers, self.action_space.low, self.action_space.high).tolist()
        shares = [exp(SHARPNESS * value) for value in limited] if self._logits else limited
        total = sum(shares)
        if total == 0.0:
            return [1.0 / len(shares)] * len(shares)
        return [share / total for share in shares]

    def observe(self, world: World) -> NDArray[np.float32]:
        """What the behaviors sense and answer."""
        return self._senses.of(self.hear(world))


class SelectionEnv(TeamEnv):
    """The action is the behavior that drives alone.

    Action: 0 .. n - 1. Observation: int64 [n], the joint state (c_1 ... c_n).
    """

    def __init__(self, behaviors: Sequence[Behavior] | None = None, **parameters: Any) -> None:
        super().__init__(behaviors, **parameters)
        self.action_space = gymnasium.spaces.Discrete(len(self.behaviors))
        self.observation_space = gymnasium.spaces.MultiDiscrete([each.tree.leaf_count for each in self.behaviors])

    def driver(self, action: Any) -> Drive:
        """Drives by the answers of one behavior. Raises ValueError if the action is not the index of one."""
        index = chosen(action, len(self.behaviors))
        return self.blended([1.0 if i == index else 0.0 for i in range(len(self.behaviors))])

    def observe(self, world: World) -> NDArray[np.int64]:
        """The joint state."""
        return np.array([output.leaf_id for output in self.hear(world)], np.int64)


def chosen(action: Any, n: int) -> int:
    """The index of a behavior that an action is. Raises ValueError for anything else."""
    index = np.asarray(action)
    if index.shape != () or index.dtype.kind not in "iu" or not 0 <= index < n:
        raise ValueError(
            f"an action is the index of a behavior, 0 .. {n - 1}, not {' '.join(str(action)[:40].split())}"
        )
    return int(index)


def shipped_behaviors() -> list[Behavior]:
    """The behaviors of the shipped trees, in fusion's order."""
    return [Behavior(name, load_tree(shipped_trees() / f"{name}.json")) for name in FusionParameters().behaviors]


gymnasium.register(id=BLEND_ID, entry_point="fbql_studies.peers.team_env:BlendEnv")
gymnasium.register(id=SELECTION_ID, entry_point="fbql_studies.peers.team_env:SelectionEnv")
