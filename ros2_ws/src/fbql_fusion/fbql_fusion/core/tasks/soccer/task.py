"""Soccer as a task of fusion: goals and collisions are rewarded, two wheels are commanded."""

from __future__ import annotations

from fbql_common.core.command_space import Command
from fbql_common.core.field import WHEELS
from fbql_common.core.types import WheelCommand, World, made_of
from fbql_recording.core.metrics import EpisodeRecord, step_bytes

from fbql_fusion.core.tasks.interface import Answers, Episode, Outcome
from fbql_fusion.core.tasks.soccer.critic import WIDTHS, critic_inputs

GOAL, OWN_GOAL, TIMEOUT = Outcome("goal", True), Outcome("own_goal", False), Outcome("timeout", False)


class SoccerTask:
    """See `core.tasks.interface.Task`.

    Args:
        goal, own_goal: their rewards.
        collision: the reward of a collision, once when it begins.
    """

    space = WHEELS
    period_s = 1.0 / 60.0
    observed_lengths = None
    critic_widths = WIDTHS

    def __init__(self, goal: float, own_goal: float, collision: float) -> None:
        self._goal = goal
        self._own_goal = own_goal
        self._collision = collision
        self._collisions_begun = 0
        self._collision_steps = 0

    def begin_episode(self) -> None:
        """Starts with no collision counted."""
        self._collisions_begun = 0
        self._collision_steps = 0

    def observed(self, world: World, answers: Answers) -> tuple[tuple[float, ...], ...]:
        """What each behavior senses; empty where it did not answer."""
        return tuple([() if x is None else x.observation for x in answers])

    def reward(self, world: World) -> float:
        """The rewards of a collision that begins and of a goal, added up."""
        reward = 0.0
        if world.collision:
            self._collision_steps += 1
        if world.collision_begun:
            self._collisions_begun += 1
            reward = self._collision
        if world.goal:
            reward += self._goal
        elif world.own_goal:
            reward += self._own_goal
        return reward

    def outcome(self, world: World) -> Outcome:
        """Goal, own goal or timeout."""
        if not world.terminated:
            return TIMEOUT
        return GOAL if world.goal else OWN_GOAL

    def command(self, world: World, command: Command) -> WheelCommand:
        """The fused wheel command."""
        return made_of(WheelCommand, (world.stamp_ns, world.episode, world.step, *command))

    def digest_bytes(self, world: World, command: Command) -> bytes:
        """See `step_bytes`."""
        left, right = command
        return step_bytes(world, left, right)

    def critic_inputs(self, world: World, mirror: bool) -> tuple[float, ...]:
        """Where ball and robot are, and how the ball rolls."""
        return critic_inputs(world, mirror)

    def record(self, episode: Episode, world: World) -> EpisodeRecord:
        """The row of an episode."""
        return EpisodeRecord(
            episode.number,
            episode.phase,
            episode.seed,
            episode.outcome.name,
            world.step,
            self._collisions_begun,
            self._collision_steps,
            episode.return_,
            episode.degraded,
        )
