"""The interface of a controller, which decides at every step how the behaviors' references are weighted.

To add one, write a class with `begin_episode` and `select`, and with the rest of `Learner` if it learns, and register it
(`core.registry`). The session does the rest: schedule, guided episodes, transitions, rewards, faults, records.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple, Protocol, runtime_checkable

from fbql_common.core.command_space import Command
from fbql_common.core.types import Phase
from numpy.typing import NDArray

from fbql_fusion.core.tasks.interface import Answers

JointState = tuple[int, ...]
"""(c_1 ... c_n): the leaf_id of each behavior."""
Selection = tuple[tuple[float, ...], int, tuple[float, ...], tuple[float, ...]]
"""(weights, driver, q, learned weights): length n; an index or DRIVER_BLEND; length n, or empty where nothing is
learned; length n, or empty where the controller does not learn.

The learned weights are the learner's w(s, B_i), also when they were only used to choose the one behavior that drives.
"""


def one_hot_weights(behaviors: int) -> tuple[tuple[float, ...], ...]:
    """The weights with which each of n behaviors drives alone, by its index."""
    return tuple(tuple(1.0 if i == driver else 0.0 for i in range(behaviors)) for driver in range(behaviors))


class Transition(NamedTuple):
    """A transition from one step to the next, from which a controller learns. It is complete: no step or answer is
    missing."""

    joint_state: JointState
    """s"""
    weights: tuple[float, ...]
    """The weights that made the command in s: the guide's in a guided episode."""
    driver: int
    """Index of the behavior that drove alone in s, or DRIVER_BLEND."""
    reward: float
    """r"""
    next_joint_state: JointState
    """s'"""
    terminated: bool
    """s' is terminal: nothing follows it, so it is worth 0."""
    truncated: bool
    """The time limit ended the episode in s'. The task continues from there, so the value of s' is given by its Q."""
    succeeded: bool = False
    """The episode ended in s' with a success."""
    command: Command = ()
    """The fused command in s."""


class Controller(Protocol):
    """Decides the weights of a step."""

    def begin_episode(self, phase: Phase) -> None:
        """A new episode begins. In a guided one the guide drives, and the selection is not executed."""
        ...

    def select(self, moment: Any, joint_state: JointState, answers: Answers) -> Selection:
        """The weights for a moment.

        Args:
            moment: what the task reports: in soccer, a `World`.
            joint_state: length n, NO_LEAF where a behavior did not answer.
            answers: length n, None where a behavior did not answer. Its weight need not be 0: blending takes care of
                that.
        """
        ...


@runtime_checkable
class Learner(Controller, Protocol):
    """A controller that learns."""

    @property
    def kind(self) -> str:
        """The name its policies carry."""
        ...

    def learn(self, transition: Transition) -> None:
        """Learns from one transition. Called once for each, in order."""
        ...

    def to_arrays(self) -> dict[str, NDArray[Any]]:
        """Everything learned."""
        ...

    def load_arrays(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Restores what `to_arrays` returned. Raises BadInput for arrays that can't come from it."""
        ...


@runtime_checkable
class Reflecting(Protocol):
    """A learner that also learns between two episodes, which may take many seconds, and not from the last transition alone."""

    def is_due(self, phase: Phase) -> bool:
        """Whether there is something to reflect on before an episode of this phase, or after the last one."""
        ...

    def reflect(self) -> None:
        """Learns. Called between two episodes when it is due, unless learning is off."""
        ...


@runtime_checkable
class Holding(Protocol):
    """A controller that holds its decisions: for some steps only the answer of the behavior that drives matters."""

    @property
    def held_driver(self) -> int:
        """The behavior that drives alone in the next step too, unless that ends the episode or the behavior can't; DRIVER_BLEND
        where it is decided anew."""
        ...

    def hold(self, moment: Any, transition: tuple[float, Command] | None) -> None:
        """Stands for `learn` and `select` in such a step.

        Args:
            moment: what the task reports.
            transition: the reward of the step before and its command, if `learn` were called.
        """
        ...


@runtime_checkable
class Drawing(Protocol):
    """A controller that draws drivers at random, but also accepts given draws: for a replay that does not know the
    state of its generator."""

    known_draw: int | None
    """The result of the next draw; None: it is drawn at random."""
    draws_taken: int
    """Number of draws whose result was given."""
