"""Who fuses: the controllers, and the protocol that each of them fulfils.

To add one: write a class with `select` (and, if it learns, the rest of `Learner`), name it in
`parameters.CONTROLLERS` and make it in `making.make_controller`. The session does the rest: schedule, guided episodes,
transitions, rewards, faults, records.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np
from fbql_common.core.types import DRIVER_BLEND, NO_LEAF, BehaviorOutput, Phase, World
from numpy.typing import NDArray

from fbql_fusion.core.equations import bounded_weights, fused_value, maxima, normalised, updated_q
from fbql_fusion.core.joint_state import JointState, JointStateTable
from fbql_fusion.core.parameters import FusionParameters
from fbql_fusion.core.subsumption import driver_of, layers_of

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


class Subsumption:
    """The highest triggered layer drives alone."""

    def __init__(self, parameters: FusionParameters) -> None:
        n = len(parameters.behaviors)
        self._layers = layers_of(parameters)
        self._alone = tuple(tuple(1.0 if i == driver else 0.0 for i in range(n)) for driver in range(n))
        self._nobody = (0.0,) * n

    def begin_episode(self, phase: Phase) -> None:
        """Nothing is remembered from one step to the next."""

    def select(self, world: World, joint_state: JointState, outputs: Sequence[BehaviorOutput | None]) -> Selection:
        """Weight 1 for the driver. Nobody drives where no layer's behavior answered."""
        driver = driver_of(self._layers, world, outputs)
        return (self._alone[driver] if driver >= 0 else self._nobody), driver, (), ()


class Uniform:
    """Every behavior weighs the same, always."""

    def __init__(self, parameters: FusionParameters) -> None:
        n = len(parameters.behaviors)
        self._selection: Selection = ((1.0 / n,) * n, DRIVER_BLEND, (), ())

    def begin_episode(self, phase: Phase) -> None:
        """Nothing changes."""

    def select(self, world: World, joint_state: JointState, outputs: Sequence[BehaviorOutput | None]) -> Selection:
        """1/n each."""
        return self._selection


class FbqlLiteral:
    """FBQL as the paper prints it: eqs. 5 and 6 at every step, with bounds and a tie rule as parameters.

    It can't learn from sparse rewards: where the Q of a state are equal, a transition with r = 0 keeps them equal
    (tests/fbql_fusion/core/test_equations.py proves it), so the tie rule decides nearly everything.
    """

    kind = "fbql_literal"

    def __init__(self, parameters: FusionParameters, generator: np.random.Generator) -> None:
        self._table = JointStateTable(len(parameters.behaviors), parameters.initial_q)
        self._generator = generator
        self._tie_rule = parameters.tie_rule
        self._learning_rate = parameters.learning_rate
        self._discount = parameters.discount
        self._weight_gain = parameters.weight_gain
        self._weight_offset = parameters.weight_offset
        self._gain_low = parameters.gain_low
        self._gain_high = parameters.gain_high
        self._weight_floor = parameters.weight_floor

    def __len__(self) -> int:
        """Number of joint states that were learned about."""
        return len(self._table)

    def begin_episode(self, phase: Phase) -> None:
        """Nothing is remembered from one step to the next."""

    def select(self, world: World, joint_state: JointState, outputs: Sequence[BehaviorOutput | None]) -> Selection:
        """The joint state's own weights. A joint state with a leaf missing is none: every behavior weighs the same."""
        if NO_LEAF in joint_state:
            return self._table.fresh[1], DRIVER_BLEND, (), ()
        q, weights = self._table.row(joint_state)
        return weights, DRIVER_BLEND, q, weights

    def learn(self, transition: Transition) -> None:
        """Eq. 5, then eq. 6 with the new Q. The weights that share the reward are the table's, also when guided."""
        state = transition.joint_state
        q, weights = self._table.row(state)
        next_value = 0.0
        if not transition.terminated:
            next_q, next_weights = self._table.row(transition.next_joint_state)
            next_value = fused_value(next_weights, next_q)
        q = updated_q(q, weights, transition.reward, next_value, self._learning_rate, self._discount)
        best = maxima(q)
        if len(best) > 1:
            best = self._break_tie(best)
        if best:
            updated = bounded_weights(
                weights, q, best, self._weight_gain, self._weight_offset, self._gain_low, self._gain_high
            )
            # Only the unbounded, printed update can leave nothing to divide by: then the weights stay.
            weights = normalised(updated, self._weight_floor) or weights
        self._table.set_row(state, q, weights)

    def _break_tie(self, best: tuple[int, ...]) -> tuple[int, ...]:
        """Which of the tied behaviors count as the argmax; none of them: no weight changes."""
        if self._tie_rule == "none":
            return ()
        if self._tie_rule == "first":
            return best[:1]
        if self._tie_rule == "random":
            return (best[int(self._generator.random() * len(best))],)
        return best

    def to_arrays(self) -> dict[str, NDArray[Any]]:
        """joint_states int32 [m, n], q float64 [m, n], weights float64 [m, n]."""
        return self._table.to_arrays()

    def load_arrays(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Takes over such arrays. Raises BadInput."""
        self._table.load_arrays(arrays)
