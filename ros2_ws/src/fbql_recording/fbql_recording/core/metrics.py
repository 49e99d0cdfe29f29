"""The counts: episodes, the run's summary, and the digest that shows whether two runs are the same.

A timeout is not a success; guided episodes are recorded, but count only towards the number of steps.
"""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from fbql_common.core.types import Phase, World

SUCCESS, TIMEOUT = "success", "timeout"
OUTCOMES = ("goal", "own_goal", TIMEOUT)
"""Those of soccer."""


@dataclass(frozen=True)
class EpisodeRecord:
    """One finished episode."""

    index: int
    phase: Phase
    seed: int
    outcome: str
    """One of OUTCOMES; in other tasks success, timeout, or a word for a failure."""
    steps: int
    collisions_begun: int
    collision_steps: int
    return_: float
    """Sum of the rewards, not discounted (`return` in episodes.csv)."""
    degraded: bool
    """A step or a behavior's answer was missing; nothing was learned from there on."""


class Summary(NamedTuple):
    """A run's result: the keys of summary.json. None where there is nothing to divide by or nothing was measured."""

    controller: str
    seed: int
    episodes: int
    goals: int
    own_goals: int
    timeouts: int
    success_rate: float | None
    """goals / episodes"""
    cost_per_goal: float | None
    """All steps of all episodes / goals."""
    mean_steps_per_goal: float | None
    """Steps of the episodes that ended in a goal / goals."""
    collisions_begun: int
    collision_steps: int
    steps: int
    """Every step that was driven, including those of guided episodes and of an unfinished one."""
    wall_s: float | None
    steps_per_s: float | None
    digest: str
    messages_recorded: int
    incomplete: bool
    """Something that should have been recorded was not."""


def summarise(
    controller: str,
    seed: int,
    records: Sequence[EpisodeRecord],
    steps: int,
    digest: str,
    wall_s: float | None = None,
    messages_recorded: int = 0,
    incomplete: bool = False,
) -> Summary:
    """The summary of a run from its episodes, its number of steps and its digest."""
    counts = _Counts.of(records, "goal")
    return Summary(
        controller=controller,
        seed=seed,
        episodes=counts.episodes,
        goals=counts.successes,
        own_goals=counts.ended("own_goal"),
        timeouts=counts.ended(TIMEOUT),
        success_rate=counts.success_rate,
        cost_per_goal=counts.cost_per_success,
        mean_steps_per_goal=counts.mean_steps_per_success,
        collisions_begun=counts.collisions_begun,
        collision_steps=counts.collision_steps,
        steps=steps,
        wall_s=wall_s,
        steps_per_s=steps / wall_s if wall_s else None,
        digest=digest,
        messages_recorded=messages_recorded,
        incomplete=incomplete,
    )


class TaskSummary(NamedTuple):
    """The result of a run of another task than soccer, whose episodes end in a success, a timeout, or a failure by any
    other word. None as in `Summary`."""

    controller: str
    seed: int
    episodes: int
    successes: int
    failures: int
    timeouts: int
    success_rate: float | None
    """successes / episodes"""
    cost_per_success: float | None
    """All steps of all episodes / successes."""
    mean_steps_per_success: float | None
    """Steps of the episodes that ended in a success / successes."""
    collisions_begun: int
    collision_steps: int
    steps: int
    wall_s: float | None
    steps_per_s: float | None
    digest: str
    messages_recorded: int
    incomplete: bool


def summarise_task(
    controller: str,
    seed: int,
    records: Sequence[EpisodeRecord],
    steps: int,
    digest: str,
    wall_s: float | None = None,
    messages_recorded: int = 0,
    incomplete: bool = False,
) -> TaskSummary:
    """The same for another task than soccer."""
    counts = _Counts.of(records, SUCCESS)
    timeouts = counts.ended(TIMEOUT)
    return TaskSummary(
        controller=controller,
        seed=seed,
        episodes=counts.episodes,
        successes=counts.successes,
        failures=counts.episodes - counts.successes - timeouts,
        timeouts=timeouts,
        success_rate=counts.success_rate,
        cost_per_success=counts.cost_per_success,
        mean_steps_per_success=counts.mean_steps_per_success,
        collisions_begun=counts.collisions_begun,
        collision_steps=counts.collision_steps,
        steps=steps,
        wall_s=wall_s,
        steps_per_s=steps / wall_s if wall_s else None,
        digest=digest,
        messages_recorded=messages_recorded,
        incomplete=incomplete,
    )


class _Counts(NamedTuple):
    """The values of the counted episodes that both summaries have, under their own names."""

    counted: Sequence[EpisodeRecord]
    """Those that are not guided."""
    steps_to_success: Sequence[int]

    @classmethod
    def of(cls, records: Sequence[EpisodeRecord], success: str) -> _Counts:
        counted = [record for record in records if record.phase is not Phase.GUIDED]
        return cls(counted, [record.steps for record in counted if record.outcome == success])

    def ended(self, outcome: str) -> int:
        """How many ended in this way."""
        return sum(record.outcome == outcome for record in self.counted)

    @property
    def episodes(self) -> int:
        return len(self.counted)

    @property
    def successes(self) -> int:
        return len(self.steps_to_success)

    @property
    def success_rate(self) -> float | None:
        return self.successes / self.episodes if self.counted else None

    @property
    def cost_per_success(self) -> float | None:
        return sum(record.steps for record in self.counted) / self.successes if self.successes else None

    @property
    def mean_steps_per_success(self) -> float | None:
        return sum(self.steps_to_success) / self.successes if self.successes else None

    @property
    def collisions_begun(self) -> int:
        return sum(record.collisions_begun for record in self.counted)

    @property
    def collision_steps(self) -> int:
        return sum(record.collision_steps for record in self.counted)


_STEP = struct.Struct("<qq7d").pack


def step_bytes(world: World, left_rad_s: float, right_rad_s: float) -> bytes:
    """The bytes that a step of soccer adds to the digest: 72, little-endian: episode, step (int64), robot x, y, yaw, ball x, y,
    left, right (float64)."""
    return _STEP(
        world.episode,
        world.step,
        world.robot_x_m,
        world.robot_y_m,
        world.robot_yaw_rad,
        world.ball_x_m,
        world.ball_y_m,
        left_rad_s,
        right_rad_s,
    )


class Digest:
    """SHA-256 over every decision in order: equal for equal runs. What each adds is up to the task."""

    def __init__(self) -> None:
        self._hash = hashlib.sha256()
        self.add = self._hash.update
        """Adds the bytes of a decision."""

    @property
    def hex(self) -> str:
        """64 hexadecimal digits. More can be added afterwards."""
        return self._hash.hexdigest()
