"""The course of a training: its budget of simulated steps, and the episodes that ended on the way."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

SLICES = 20


class TrainingEpisode(NamedTuple):
    """An episode of a training."""

    at_step: int
    """Steps of the whole training when it ended."""
    steps: int
    outcome: str
    """goal, own_goal or timeout."""


class Course:
    """Counts the training. Steps are those of the simulator, in all environments together: the common currency of all
    peers."""

    def __init__(self, budget: int, environments: int = 1) -> None:
        self.budget = budget
        self.steps = 0
        self.episodes: list[TrainingEpisode] = []
        self._running = [0] * environments

    @property
    def is_over(self) -> bool:
        """Whether the budget is used up."""
        return self.steps >= self.budget

    @property
    def share(self) -> float:
        """How much of the budget is used up, 0 .. 1."""
        return min(self.steps / self.budget, 1.0)

    def add(self, info: Mapping[str, Any], ended: bool, environment: int = 0) -> None:
        """Counts one step of an environment, by its info."""
        self.steps += info["steps"]
        self._running[environment] += info["steps"]
        if ended:
            outcome = "goal" if info["goal"] else "own_goal" if info["own_goal"] else "timeout"
            self.end(self._running[environment], outcome)
            self._running[environment] = 0

    def end(self, steps: int, outcome: str) -> None:
        """Counts an episode whose steps have been counted already."""
        self.episodes.append(TrainingEpisode(self.steps, steps, outcome))

    def slices(self) -> list[dict[str, int]]:
        """The learning curve: episodes and outcomes that ended in each of SLICES equal parts of the budget."""
        found = [dict.fromkeys(("episodes", "goals", "own_goals", "timeouts", "steps"), 0) for _ in range(SLICES)]
        for episode in self.episodes:
            row = found[min(episode.at_step * SLICES // self.budget, SLICES - 1)]
            row["episodes"] += 1
            row[f"{episode.outcome}s"] += 1
            row["steps"] += episode.steps
        return found
