"""Equations 1-4 of the paper, one pure function each.

They accept floats and NumPy arrays alike, so that the slow literal tests and the fast induction share the same code.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import log

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]


def entropy(class_counts: Sequence[int]) -> float:
    """Eq. 2: Entropy = -sum_i p_i ln p_i [nat], with p_i the share of class i among the patterns. Empty: 0."""
    total = sum(class_counts)
    return -sum(count / total * log(count / total) for count in class_counts if count)


def information_gain[Values: (float, Floats)](
    entropy_node: Values, entropy_left: Values, entropy_right: Values, n_left: Values, n_right: Values
) -> Values:
    """Eq. 1: entropy of the node minus the mean entropy of its children, weighted by their patterns [nat]."""
    return entropy_node - (n_left * entropy_left + n_right * entropy_right) / (n_left + n_right)


def split_reward[Values: (float, Floats)](split_cost: float, gain: Values) -> Values:
    """Eq. 3 for a splitting action: r_split + I_gain. A no-split action earns 0. `split_cost` is not positive."""
    return split_cost + gain


def children_value[Values: (float, Floats)](value_left: Values, value_right: Values, share: float) -> Values:
    """The successors' term of eq. 4: (max Q(left) + max Q(right)) times `share`; the paper's share is 1/2."""
    return (value_left + value_right) * share


def q_update(q: float, target: float, learning_rate: float) -> float:
    """Eq. 4: Q + alpha (R + gamma * successors - Q); `target` is R + gamma * successors.

    The paper prints it without the last -Q, with which the fixed point would be target = 0: see `q_update_printed`.
    """
    return q + learning_rate * (target - q)


def q_update_printed(q: float, target: float, learning_rate: float) -> float:
    """Eq. 4 as printed, without -Q: Q + alpha * target. It diverges; kept to show that it does."""
    return q + learning_rate * target
