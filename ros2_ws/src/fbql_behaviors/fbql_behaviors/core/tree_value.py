"""The value of any tree by the objective of induction: it makes trees of different methods comparable."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from fbql_behaviors.core.equations import children_value, entropy, information_gain, split_reward
from fbql_behaviors.core.induction import InductionParameters, children_share
from fbql_behaviors.core.patterns import Patterns
from fbql_behaviors.core.tree import Split, Tree


def tree_value(tree: Tree, patterns: Patterns, parameters: InductionParameters) -> float:
    """The value of the root [nat]: R + gamma * successors down the tree's own splits (eqs. 1-4).

    For the tree that `dp` induces from these patterns it is the optimum. A split with an empty side earns only its cost.
    """
    share = children_share(parameters)
    rows: list[npt.NDArray[np.int64]] = [np.empty(0, np.int64)] * len(tree.nodes)
    rows[0] = np.arange(len(patterns))
    order: list[int] = []
    pending = [0]
    while pending:
        index = pending.pop()
        order.append(index)
        node = tree.nodes[index]
        if isinstance(node, Split):
            here = rows[index]
            goes_left = patterns.x[here, node.feature] < node.threshold
            rows[node.left], rows[node.right] = here[goes_left], here[~goes_left]
            pending += [node.right, node.left]
    values = [0.0] * len(tree.nodes)
    impurity = [_entropy(patterns, part) for part in rows]
    for index in reversed(order):
        node = tree.nodes[index]
        if isinstance(node, Split):
            gain = 0.0
            n_left, n_right = len(rows[node.left]), len(rows[node.right])
            if n_left and n_right:
                gain = information_gain(
                    impurity[index], impurity[node.left], impurity[node.right], float(n_left), float(n_right)
                )
            if parameters.objective == "weighted":
                gain *= len(rows[index]) / len(patterns)
            below = children_value(values[node.left], values[node.right], share)
            values[index] = split_reward(parameters.split_cost, gain) + parameters.discount * below
    return values[0]


def _entropy(patterns: Patterns, rows: npt.NDArray[np.int64]) -> float:
    _, counts = np.unique(patterns.wheel_class[rows], return_counts=True)
    return entropy(counts.tolist())
