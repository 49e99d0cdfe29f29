"""A session of soccer."""

from __future__ import annotations

from collections.abc import Sequence

from fbql_common.core.errors import BadInput
from fbql_common.core.types import WheelCommand, World
from fbql_recording.core.metrics import EpisodeRecord, Summary, summarise

from fbql_fusion.core.learners.dyna.learner import FbqlModel
from fbql_fusion.core.parameters import FusionParameters, check_fusion
from fbql_fusion.core.policy import Policy
from fbql_fusion.core.registry import is_ours, make_controller
from fbql_fusion.core.session import Session
from fbql_fusion.core.tasks.soccer.subsumption import Subsumption
from fbql_fusion.core.tasks.soccer.task import SoccerTask
from fbql_fusion.core.tasks.soccer.world_model.imagination import Rewards
from fbql_fusion.core.tasks.soccer.world_model.soccer_imagination import (
    PlayingTree,
    SoccerImagination,
    why_not_imagined,
)


def imagines(parameters: FusionParameters) -> bool:
    """Whether the controller would imagine episodes, for which it needs the trees."""
    return parameters.controller == "fbql_model" and parameters.learn


def plays_instead(parameters: FusionParameters, trees: Sequence[PlayingTree]) -> str:
    """One line that says why fbql plays in the place of fbql_model, which can't imagine; "" if it does not."""
    why = why_not_imagined(parameters.behaviors, trees) if imagines(parameters) else ""
    return f"fbql_model can't imagine episodes, so fbql learns in its place: {why}" if why else ""


def _imagination(
    parameters: FusionParameters, rewards: Rewards, trees: Sequence[PlayingTree]
) -> SoccerImagination | None:
    if parameters.controller != "fbql_model" or plays_instead(parameters, trees):
        return None
    return SoccerImagination(parameters, rewards, trees if imagines(parameters) else ())


class SoccerSession(Session[World, WheelCommand, EpisodeRecord]):
    """One run of soccer; Subsumption is its guide.

    Args:
        parameters: what is played.
        policy: what an earlier run learned, to continue from.
        trees: of the behaviors, in order, if they are known: only fbql_model needs them, to imagine episodes.

    Raises:
        BadInput: parameters that are wrong, or a policy that does not belong to them.
    """

    def __init__(
        self, parameters: FusionParameters, policy: Policy | None = None, trees: Sequence[PlayingTree] = ()
    ) -> None:
        check_fusion(parameters, "fusion")
        rewards = Rewards(parameters.reward_goal, parameters.reward_own_goal, parameters.collision_reward)
        instead = plays_instead(parameters, trees)
        if instead and policy is not None and policy.kind == FbqlModel.kind:
            raise BadInput(
                f"{instead}; fbql can't continue from this policy of fbql_model, which only plays (learn false)"
            )
        task, guide = SoccerTask(*rewards), Subsumption(parameters)
        imagination = _imagination(parameters, rewards, trees)
        super().__init__(parameters, task, guide, make_controller(parameters, task, guide, imagination), policy)
        self.parameters: FusionParameters = parameters

    @property
    def forgets_episodes(self) -> bool:
        """Whether decisions depend on nothing before their episode, except random draws (`drawing`): nothing is
        learned. False for a user's own controller, because what it remembers is unknown."""
        return is_ours(self.parameters.controller) and not self.is_learning

    def summary(self, wall_s: float | None = None, messages_recorded: int = 0, incomplete: bool = False) -> Summary:
        """The result so far, including what only the caller knows."""
        return summarise(
            self.parameters.controller,
            self.parameters.seed,
            self.records,
            self.steps,
            self.digest,
            wall_s,
            messages_recorded,
            incomplete,
        )
