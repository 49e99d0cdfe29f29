"""FBQL as the paper prints it: one learner that updates Q and weights of a table at every step (eqs. 5 and 6)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from fbql_common.core.types import DRIVER_BLEND, NO_LEAF, Phase
from numpy.typing import NDArray

from fbql_fusion.core.controllers.interface import JointState, Selection, Transition
from fbql_fusion.core.learners.literal.equations import bounded_weights, fused_value, maxima, normalised, updated_q
from fbql_fusion.core.learners.literal.parameters import LiteralParameters
from fbql_fusion.core.learners.literal.table import JointStateTable
from fbql_fusion.core.tasks.interface import Answers


class FbqlLiteral:
    """FBQL as the paper prints it: eqs. 5 and 6 at every step, with bounds and a tie rule as parameters.

    It can't learn from sparse rewards: where the Q of a state are equal, a transition with r = 0 keeps them equal
    (tests/fbql_fusion/core/learners/literal/test_equations.py proves it), so the tie rule decides nearly everything.
    """

    kind = "fbql_literal"

    def __init__(self, parameters: LiteralParameters, generator: np.random.Generator) -> None:
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

    def begin_episode(self, phase: Phase) -> None:
        """Does nothing: nothing is remembered from one step to the next."""

    def select(self, moment: Any, joint_state: JointState, answers: Answers) -> Selection:
        """The joint state's own weights. With a leaf missing there is no joint state: every behavior weighs the
        same."""
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
        """Restores such arrays. Raises BadInput."""
        self._table.load_arrays(arrays)
