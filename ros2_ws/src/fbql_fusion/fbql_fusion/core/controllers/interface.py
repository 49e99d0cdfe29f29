"""What a controller is: it decides, at every step, how the behaviors' references are weighed.

To add one, write a class with `begin_episode` and `select`, and with the rest of `Learner` if it learns, and register it
(`core.registry`). The session does the rest: schedule, guided episodes, transitions, rewards, faults, records.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, Protocol, runtime_checkable

from fbql_common.core.types import BehaviorOutput, Phase, World
from numpy.typing import NDArray

JointState = tuple[int, ...]
"""(c_1 ... c_n): the leaf_id of each behavior."""
Selection = tuple[tuple[float, ...], int, tuple[float, ...], tuple[float, ...]]
"""(weights, driver, q, learned weights): length n; an index or DRIVER_BLEND; length n, or empty where nothing is learned;
length n, or empty where the controller does not learn.

The learned weights are w(s, B_i) as the learner has them, also where one behavior drives alone, chosen by them.
"""


class Transition(NamedTuple):
    """From one step to the next: what a controller learns from. It is complete: no step or answer is missing."""

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
    """The time limit ended the episode in s'. The task goes on from there, so s' is worth what its Q says."""


class Controller(Protocol):
    """Decides the weights of a step."""

    def begin_episode(self, phase: Phase) -> None:
        """A new episode begins. In a guided one the guide drives instead of what is selected."""
        ...

    def select(self, world: World, joint_state: JointState, outputs: Sequence[BehaviorOutput | None]) -> Selection:
        """The weights for a world state.

        Args:
            world: the world state.
            joint_state: length n, NO_LEAF where a behavior did not answer.
            outputs: length n, None where a behavior did not answer. Its weight need not be 0: blending sees to it.
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
        """Takes over what `to_arrays` gave. Raises BadInput where the arrays can't be it."""
        ...
