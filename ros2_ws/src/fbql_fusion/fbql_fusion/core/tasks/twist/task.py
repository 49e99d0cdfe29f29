"""Any robot that takes velocity commands as a task of fusion. The reward and the ends of episodes come from outside."""

from __future__ import annotations

from collections.abc import Sequence
from struct import pack

from fbql_common.core.command_space import Command, CommandSpace
from fbql_recording.core.metrics import SUCCESS, TIMEOUT, EpisodeRecord

from fbql_fusion.core.tasks.interface import Answers, Episode, Outcome
from fbql_fusion.core.tasks.twist.moment import MuxMoment

FAILURE, COLLISION = "failure", "collision"


class MuxTask:
    """See `core.tasks.interface.Task`.

    Args:
        space: the axes of the robot's velocity that its sources use.
        period_s: time from one moment to the next.
        observed_lengths: how many numbers each group of the moments' `observed` has.
        critic_widths: see `Task.critic_widths`.
    """

    def __init__(
        self,
        space: CommandSpace,
        period_s: float,
        observed_lengths: Sequence[int],
        critic_widths: Sequence[Sequence[float]] = (),
    ) -> None:
        self.space = space
        self.period_s = period_s
        self.observed_lengths = tuple(observed_lengths)
        self.critic_widths = tuple(tuple(group) for group in critic_widths)

    def begin_episode(self) -> None:
        """Does nothing: there is nothing to count."""

    def observed(self, moment: MuxMoment, answers: Answers) -> tuple[tuple[float, ...], ...]:
        """The moment's own groups."""
        return moment.observed

    def reward(self, moment: MuxMoment) -> float:
        """The reward, as it was received."""
        return moment.reward

    def outcome(self, moment: MuxMoment) -> Outcome:
        """A terminated episode ends with the word that was received; only "success" is a success, and no word is a failure. Any other
        episode ends by a timeout."""
        if not moment.terminated:
            return Outcome(TIMEOUT, False)
        name = moment.outcome or FAILURE
        return Outcome(name, name == SUCCESS)

    def command(self, moment: MuxMoment, command: Command) -> Command:
        """The command itself, a value per axis."""
        return command

    def digest_bytes(self, moment: MuxMoment, command: Command) -> bytes:
        """Episode and step (int64), the observations and the command (float64), little-endian."""
        numbers = [*[x for group in moment.observed for x in group], *command]
        return pack(f"<qq{len(numbers)}d", moment.episode, moment.step, *numbers)

    def critic_inputs(self, moment: MuxMoment, mirror: bool) -> tuple[float, ...]:
        """The critic's inputs as they were given; they have no mirror image."""
        return moment.critic_inputs

    def record(self, episode: Episode, moment: MuxMoment) -> EpisodeRecord:
        """The row of an episode. The outcome "collision" counts as a collision that began; other collisions are unknown."""
        outcome = episode.outcome.name
        return EpisodeRecord(
            episode.number,
            episode.phase,
            episode.seed,
            outcome,
            moment.step,
            int(outcome == COLLISION),
            0,
            episode.return_,
            episode.degraded,
        )
