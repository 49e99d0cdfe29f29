"""A session of a robot that takes velocity commands from several sources."""

from __future__ import annotations

from fbql_common.core.command_space import Command
from fbql_recording.core.metrics import EpisodeRecord, TaskSummary, summarise_task

from fbql_fusion.core.policy import Policy
from fbql_fusion.core.registry import make_controller
from fbql_fusion.core.session import Session
from fbql_fusion.core.tasks.interface import Guide
from fbql_fusion.core.tasks.twist.moment import MuxMoment
from fbql_fusion.core.tasks.twist.parameters import MuxLearningParameters, check_mux_learning
from fbql_fusion.core.tasks.twist.task import MuxTask


class MuxSession(Session[MuxMoment, Command, EpisodeRecord]):
    """One run of a robot.

    Args:
        parameters: what decides; `behaviors` names the sources.
        task: the robot, with the same period as the parameters.
        guide: who would drive without learning, by priorities.
        policy: what an earlier run learned, to continue from.

    Raises:
        BadInput: parameters that are wrong, or a policy that does not belong to them.
    """

    def __init__(
        self, parameters: MuxLearningParameters, task: MuxTask, guide: Guide, policy: Policy | None = None
    ) -> None:
        check_mux_learning(parameters, "mux")
        super().__init__(parameters, task, guide, make_controller(parameters, task, guide), policy)
        self.parameters: MuxLearningParameters = parameters

    def summary(self, wall_s: float | None = None, messages_recorded: int = 0, incomplete: bool = False) -> TaskSummary:
        """The result so far, including what only the caller knows."""
        return summarise_task(
            self.parameters.controller,
            self.parameters.seed,
            self.records,
            self.steps,
            self.digest,
            wall_s,
            messages_recorded,
            incomplete,
        )
