"""A task as fusion sees it: moments, answers, a reward and outcomes. Fusion does not know which task it is.

Soccer is one task (`core.tasks.soccer`). Your own task implements `Task`, and sessions, learners and policies then work with it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np
from fbql_common.core.command_space import Command, CommandSpace
from numpy.typing import NDArray


class Moment(Protocol):
    """One point in time at which something is decided, as the task reports it."""

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
        """Whether the episode ended, for either reason."""
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
        """SHA-256 of whatever defines the leaves; a policy belongs to it."""
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
        """Whether it may drive. A source that is silent or masked still answers, with a leaf of its own and False."""
        ...


Answers = Sequence[Answer | None]
"""Length n, None where a behavior did not answer in time or its answer can't be used."""


class Outcome(NamedTuple):
    """How an episode ended."""

    name: str
    """A word of the task, such as "goal"."""
    success: bool


class Guide(Protocol):
    """Chooses a driver without learning: a baseline, the driver of guided episodes, and a prior."""

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
        """The observations, in groups of numbers; a group that is unknown is empty."""
        ...

    @property
    def observed_lengths(self) -> tuple[int, ...] | None:
        """How many numbers each group has; None: one group per behavior, whose length is known once it has answered."""
        ...

    def reward(self, moment: M, /) -> float:
        """The reward of the transition that ended at a moment. Counts that moment's events."""
        ...

    def outcome(self, moment: M, /) -> Outcome:
        """How the episode ended at a moment."""
        ...

    def command(self, moment: M, command: Command, /) -> C:
        """The command that answers a moment, as it is published."""
        ...

    def digest_bytes(self, moment: M, command: Command, /) -> bytes:
        """The bytes of a moment and its command that go into the digest."""
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
        """The record of an episode that ended at a moment."""
        ...


class Imagined(NamedTuple):
    """E imagined episodes with N decisions in all, one after the other."""

    lengths: NDArray[np.int64]
    """Decisions of each episode, [E]."""
    terminated: NDArray[np.bool_]
    """Whether each was terminated; False at a time limit, [E]."""
    rows: NDArray[np.int64]
    """Features of each episode's decisions, and then of the situation that it ended in, those of the critic included,
    [N + E, F + F']."""
    drivers: NDArray[np.int64]
    """The behavior that drove after each decision, [N]."""
    old_probs: NDArray[np.float64]
    """The weight by which it was drawn, [N]."""
    rewards: NDArray[np.float64]
    """R of each decision, [N]."""
    discounts: NDArray[np.float64]
    """gamma^k of each decision, [N]."""


class Imagination(Protocol):
    """A model of a task, fitted to the real steps so far, in which episodes can be played.

    A real episode is given by `begin`, then `add` for every step. An episode with a missing step is dropped.
    """

    @property
    def tree_hashes(self) -> tuple[str, ...]:
        """SHA-256 of the trees of the behaviors that play in it, length n."""
        ...

    def begin(self, moment: Any, /) -> None:
        """The first moment of a real episode."""
        ...

    def add(self, command: Command, moment: Any, /) -> None:
        """Adds a step: the command that was given, and the moment to which it led."""
        ...

    def forget_episode(self) -> None:
        """Drops the episode that has not ended, if there is one."""
        ...

    def fit(self, features: Any, generator: np.random.Generator, /) -> bool:
        """Fits the model to the real episodes that have ended. False if they are too few: nothing can be imagined.

        Args:
            features: `learners.features.Features`, which distinguish the imagined situations.
        """
        ...

    def play(
        self,
        theta: NDArray[np.float64],
        episodes: int,
        hold_steps: int,
        discount: float,
        generator: np.random.Generator,
        /,
    ) -> Imagined:
        """Plays episodes in the model as it was fitted last; drivers are drawn by eq. 10.

        Args:
            theta: the table of eq. 10, [features, n].
        """
        ...

    def to_arrays(self) -> dict[str, NDArray[Any]]:
        """The real steps that are kept, of episodes that have ended."""
        ...

    def load_arrays(self, arrays: Mapping[str, NDArray[Any]], /) -> None:
        """Restores what `to_arrays` returned. Raises BadInput for arrays that can't come from it."""
        ...


class Episode(NamedTuple):
    """What the session knows about an episode that ended."""

    number: int
    phase: Any
    """`types.Phase`"""
    seed: int
    outcome: Outcome
    return_: float
    """Sum of the rewards, not discounted."""
    degraded: bool
    """A step or an answer was missing; nothing was learned from there on."""
