"""A session of soccer."""

from __future__ import annotations

from fbql_common.core.types import WheelCommand, World
from fbql_recording.core.metrics import EpisodeRecord, Summary, summarise

from fbql_fusion.core.parameters import FusionParameters, check_fusion
from fbql_fusion.core.policy import Policy
from fbql_fusion.core.registry import is_ours, make_controller
from fbql_fusion.core.session import Session
from fbql_fusion.core.tasks.soccer.subsumption import Subsumption
from fbql_fusion.core.tasks.soccer.task import SoccerTask


class SoccerSession(Session[World, WheelCommand, EpisodeRecord]):
    """One run of soccer; Subsumption is its guide.

    Args:
        parameters: what is played.
        policy: what an earlier run learned, to continue from.

    Raises:
        BadInput: parameters that are wrong, or a policy that does not belong to them.
    """

    def __init__(self, parameters: FusionParameters, policy: Policy | None = None) -> None:
        check_fusion(parameters, "fusion")
        task = SoccerTask(parameters.reward_goal, parameters.reward_own_goal, parameters.collision_reward)
        guide = Subsumption(parameters)
        super().__init__(parameters, task, guide, make_controller(parameters, task, guide), policy)
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
