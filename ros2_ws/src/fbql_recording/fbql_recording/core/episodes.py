"""The episodes of a recording, from its steps."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from fbql_common.core.types import Phase

from fbql_recording.core.steps import Step


@dataclass
class Episode:
    """One episode as it was recorded. None is "n/a": the recording does not contain it."""

    index: int
    """Its number in the run."""
    first_step: int
    """Index of its first step among those of the recording."""
    recorded_steps: int = 0
    """Number of its recorded steps: steps[first_step : first_step + recorded_steps]."""
    phase: str | None = None
    """guided, learning or evaluation."""
    seed: int | None = None
    """From the run's episodes.csv."""
    outcome: str | None = None
    """goal, own_goal or timeout; None: the recording ends, or the episode was lost and restarted, before its end."""
    steps: int = 0
    """Number of its last step, which is the number of steps driven."""
    collisions_begun: int | None = None
    collision_steps: int | None = None
    return_: float | None = None
    """Sum of the rewards."""
    degraded: bool | None = None
    """Whether a step or an answer was missing, so that not all of it was learned from."""
    begin_ns: int = 0
    """Stamp of its first step [ns]."""
    end_ns: int = 0
    """Stamp of its last step [ns]."""


def episodes_of(steps: Iterable[Step]) -> Iterator[Episode]:
    """The episodes of a recording, each as it ends; an episode that restarted occurs twice."""
    episode: Episode | None = None
    for index, step in enumerate(steps):
        now = episode_with(episode, index, step)
        if episode is not None and now is not episode:
            yield episode
        episode = now
    if episode is not None:
        yield episode


def episode_with(episode: Episode | None, index: int, step: Step) -> Episode:
    """The episode that a step belongs to, with the step in it: the one before it, or a new one.

    Args:
        episode: that of the step before; None for the first step.
        index: of the step among those of the recording.
    """
    begins = episode is None or step.episode != episode.index or step.step <= episode.steps
    if episode is None or begins or step.begins_again:
        episode = Episode(step.episode, index, begin_ns=step.stamp_ns)
    _add(episode, step)
    return episode


def _add(episode: Episode, step: Step) -> None:
    episode.recorded_steps += 1
    episode.steps = step.step
    episode.end_ns = step.stamp_ns
    world, decision = step.world, step.decision
    if world is not None:
        episode.collisions_begun = (episode.collisions_begun or 0) + world.collision_begun
        episode.collision_steps = (episode.collision_steps or 0) + world.collision
        if world.terminated:
            episode.outcome = "goal" if world.goal else "own_goal"
        elif world.truncated:
            episode.outcome = "timeout"
    if decision is not None:
        phases = {int(phase): phase.name.lower() for phase in Phase}
        episode.phase = phases.get(decision.phase)
        episode.return_ = (episode.return_ or 0.0) + decision.reward
        episode.degraded = bool(episode.degraded) or decision.degraded
