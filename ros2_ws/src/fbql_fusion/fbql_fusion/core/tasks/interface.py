"""A task as fusion sees it: moments, answers, a reward and outcomes. Which task it is, fusion does not know.

Soccer is one task (`core.tasks.soccer`); a task of your own implements `Task`, and gets sessions, learners and policies.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple, Protocol

from fbql_common.core.command_space import Command, CommandSpace


class Moment(Protocol):
    """One point in time at which something is decided: what the task reports."""

    @property
    def stamp_ns(self) -> int:
        """Time of the task's clock [ns]."""
        ...

    @property
    def episode(self) -> int:
        """Its episode, counted from 0."""
        ...

    @property
    def step(self) -> int:
        """Its step within the episode, counted from 0."""
        ...

    @property
    def terminated(self) -> bool:
        """The task ended the episode: nothing follows."""
        ...

    @property
    def truncated(self) -> bool:
        """The episode ended, but the task had not: a time limit."""
        ...

    @property
    def ended(self) -> bool:
        """For either reason."""
        ...


class Answer(Protocol):
    """One behavior's answer to a moment."""

    @property
    def command(self) -> Command:
        """What the robot should do, in the task's command space."""
        ...

    @property
    def leaf_id(self) -> int:
        """Why: the leaf, or class, that the behavior's input falls into, 0 .. leaf_count - 1."""
        ...

    @property
    def leaf_count(self) -> int:
        """Number of leaves."""
        ...

    @property
    def tree_hash(self) -> str:
        """SHA-256 of what makes the leaves: a policy belongs to it."""
        ...

    @property
    def clamped(self) -> bool:
        """The behavior's input lay outside of what was demonstrated."""
        ...

    @property
    def observation(self) -> tuple[float, ...]:
        """What the behavior senses."""
        ...

    @property
    def active(self) -> bool:
        """Whether it may drive. False for a source that is silent, or masked: it answers, with a leaf for that."""
        ...


Answers = Sequence[Answer | None]
"""Length n, None where a behavior did not answer in time or its answer can't be used."""


class Outcome(NamedTuple):
    """How an episode ended."""

    name: str
    """A word of the task, such as "goal"."""
    success: bool


class Guide(Protocol):
    """Who would drive now, without learning: the baseline, the driver of the guided episodes, and a prior."""

    def driver(self, moment: Any, answers: Answers, /) -> int:
        """Index of the behavior that would drive; DRIVER_BLEND if none can."""
        ...


class Task[M: Moment, C, R](Protocol):
    """What a session plays. It receives every moment in order. M: its moments, C: its commands as they are
    published, R: its records of episodes."""

    @property
    def space(self) -> CommandSpace:
        """The commands that the robot takes."""
        ...

    @property
    def period_s(self) -> float:
        """Time from one moment to the next [s]; durations are rounded to whole periods."""
        ...

    def begin_episode(self) -> None:
        """Starts the counts of an episode."""
        ...

    def observed(self, moment: M, answers: Answers, /) -> tuple[tuple[float, ...], ...]:
        """What is sensed, in groups of numbers; empty where one is not known."""
        ...

    @property
    def observed_lengths(self) -> tuple[int, ...] | None:
        """How many numbers each group has; None: one group for each behavior, whose length shows when it answers."""
        ...

    def reward(self, moment: M, /) -> float:
        """The reward of the transition that ended in a moment, whose events are counted."""
        ...

    def outcome(self, moment: M, /) -> Outcome:
        """How the episode ended in a moment."""
        ...

    def command(self, moment: M, command: Command, /) -> C:
        """The command that answers a moment, as it is published."""
        ...

    def digest_bytes(self, moment: M, command: Command, /) -> bytes:
        """What the digest takes of a moment and its command."""
        ...

    def critic_inputs(self, moment: M, mirror: bool, /) -> tuple[float, ...]:
        """Inputs that only the critic sees, in addition to what the behaviors sense; needed only while learning."""
        ...

    @property
    def critic_widths(self) -> tuple[tuple[float, ...], ...]:
        """How the critic's inputs are tiled: for each group of them the width of a tile along each component, 0 where the
        group leaves it out. Empty: the critic sees nothing more."""
        ...

    def record(self, episode: Episode, moment: M, /) -> R:
        """The record of an episode that ended in a moment."""
        ...


class Episode(NamedTuple):
    """What the session knows of an episode that ended."""

    number: int
    phase: Any
    """`types.Phase`"""
    seed: int
    outcome: Outcome
    return_: float
    """Sum of the rewards, not discounted."""
    degraded: bool
    """A step or an answer was missing; nothing was learned from there on."""
