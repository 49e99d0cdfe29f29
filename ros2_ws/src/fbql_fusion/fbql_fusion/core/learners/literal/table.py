"""The table of joint states: Q and weights of only those joint states that were updated."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from fbql_common.core.errors import BadInput
from numpy.typing import NDArray

from fbql_fusion.core.controllers.interface import JointState
from fbql_fusion.core.learners.policy_arrays import check_arrays, rows_of

Row = tuple[tuple[float, ...], tuple[float, ...]]
"""(q, weights) of one joint state, each of length n."""

_SUM_TOLERANCE = 1e-6


class JointStateTable:
    """A sparse table: memory grows with the joint states that were learned about, never with the product of leaves.

    Args:
        behaviors: n.
        initial_q: Q of a joint state that has no row yet; its weights are 1/n.
    """

    def __init__(self, behaviors: int, initial_q: float) -> None:
        self.fresh: Row = ((initial_q,) * behaviors, (1.0 / behaviors,) * behaviors)
        self._rows: dict[JointState, Row] = {}

    def __len__(self) -> int:
        return len(self._rows)

    def row(self, joint_state: JointState) -> Row:
        """The row of a joint state, or a fresh one. Reading does not create a row."""
        return self._rows.get(joint_state, self.fresh)

    def set_row(self, joint_state: JointState, q: tuple[float, ...], weights: tuple[float, ...]) -> None:
        """Replaces, or begins, the row of a joint state."""
        self._rows[joint_state] = (q, weights)

    def to_arrays(self) -> dict[str, NDArray[Any]]:
        """All rows, sorted by joint state: joint_states int32 [m, n], q float64 [m, n], weights float64 [m, n]."""
        n = len(self.fresh[0])
        states = sorted(self._rows)
        rows = [self._rows[state] for state in states]
        return {
            "joint_states": np.array(states, dtype=np.int32).reshape(-1, n),
            "q": np.array([q for q, _ in rows], dtype=np.float64).reshape(-1, n),
            "weights": np.array([weights for _, weights in rows], dtype=np.float64).reshape(-1, n),
        }

    def load_arrays(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Restores rows as `to_arrays` returns them.

        Raises:
            BadInput: an array is missing, or of another shape or type, or has a value that is not finite,
                a leaf_id below 0, weights that do not sum to 1, or a joint state twice.
        """
        shape = (rows_of(arrays, "joint_states"), len(self.fresh[0]))
        check_arrays(arrays, {"joint_states": ("l", shape), "q": ("f", shape), "weights": ("f", shape)})
        if arrays["joint_states"].size and arrays["joint_states"].min() < 0:
            raise BadInput("the policy's array 'joint_states' has a leaf_id below 0")
        if (np.abs(arrays["weights"].sum(axis=1) - 1.0) > _SUM_TOLERANCE).any():
            raise BadInput("the policy's array 'weights' has weights that do not sum to 1")
        states: list[list[int]] = arrays["joint_states"].tolist()
        q: list[list[float]] = arrays["q"].tolist()
        weights: list[list[float]] = arrays["weights"].tolist()
        rows = {
            tuple(state): (tuple(q_row), tuple(weight_row))
            for state, q_row, weight_row in zip(states, q, weights, strict=True)
        }
        if len(rows) != len(states):
            raise BadInput("the policy's array 'joint_states' has a joint state twice")
        self._rows = rows
