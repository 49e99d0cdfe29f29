"""Nearest neighbours: regression with several outputs by the rows whose inputs are most alike.

The rows are in a k-d tree (Bentley 1975, Communications of the ACM 18): each node divides its rows in two halves along the input
that varies most there. The prediction of one of the k nearest rows, drawn at random, has the spread of the data.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from fbql_common.core.kernels import kernel
from numpy.typing import NDArray

from fbql_fusion.core.learners.linear import Floats

_LEAF_ROWS = 12
"""Most rows of a node that is not divided."""
MOST_LEAVES = 32
"""Leaves after which a search ends with the nearest rows found so far: with many rows it is approximate, and its time is
bounded."""


class Neighbours(NamedTuple):
    """N rows with d inputs and m outputs, in the order of the leaves of a k-d tree.

    Node i has the children 2 i + 1 and 2 i + 2; the rows of a node are divided in the middle.
    """

    inputs: Floats
    """Each divided by its scale, [N, d]."""
    outputs: Floats
    """[N, m]"""
    scale: Floats
    """Standard deviation of each input, [d]."""
    axes: NDArray[np.int64]
    """The input that a node divides its rows by; -1 for a leaf, [nodes]."""
    cuts: Floats
    """No input of the first half lies above it, none of the second half below it, [nodes]."""


def no_neighbours(inputs: int, outputs: int) -> Neighbours:
    """Neighbours that predict nothing."""
    return Neighbours(
        np.empty((0, inputs)), np.empty((0, outputs)), np.ones(inputs), np.empty(0, dtype=np.int64), np.empty(0)
    )


def fit_neighbours(x: Floats, y: Floats) -> Neighbours:
    """Keeps N rows, at least one: inputs [N, d] and outputs [N, m]."""
    scale = x.std(axis=0)
    scale[scale < 1e-12] = 1.0
    inputs = x / scale
    depth = 0
    while len(x) > _LEAF_ROWS << depth:
        depth += 1
    axes = np.full((2 << depth) - 1, -1, dtype=np.int64)
    cuts = np.zeros(len(axes))
    order = np.arange(len(x))
    pending = [(0, 0, len(x))]
    while pending:
        node, begin, end = pending.pop()
        if end - begin <= _LEAF_ROWS:
            continue
        own = inputs[order[begin:end]]
        axis = int(np.argmax(own.max(axis=0) - own.min(axis=0)))
        ranks = np.argsort(own[:, axis], kind="stable")
        order[begin:end] = order[begin:end][ranks]
        middle = (begin + end) // 2
        axes[node], cuts[node] = axis, own[ranks[middle - begin], axis]
        pending += [(2 * node + 1, begin, middle), (2 * node + 2, middle, end)]
    return Neighbours(np.ascontiguousarray(inputs[order]), np.ascontiguousarray(y[order]), scale, axes, cuts)


@kernel
def nearest(neighbours: Neighbours, x: Floats, count: int) -> NDArray[np.int64]:
    """The rows whose inputs are nearest to x, as far as MOST_LEAVES leaves show, the nearest first, [min(count, N)].

    Args:
        x: [d], or longer.
    """
    inputs, scale = neighbours.inputs, neighbours.scale
    rows, d = inputs.shape
    found = min(count, rows)
    chosen = np.zeros(found, dtype=np.int64)
    squares = np.full(found, np.inf)
    at = np.empty(d)
    for j in range(d):
        at[j] = x[j] / scale[j]
    # of each waiting node: itself, its rows, how far it is at least, and how far along each input
    nodes = np.empty((64, 3), dtype=np.int64)
    bounds = np.empty(64)
    aside = np.zeros((64, d))
    nodes[0, 0], nodes[0, 1], nodes[0, 2], bounds[0] = 0, 0, rows, 0.0
    waiting, leaves = 1, 0
    while waiting and leaves < MOST_LEAVES:
        waiting -= 1
        bound = bounds[waiting]
        if bound >= squares[found - 1]:
            continue
        node, begin, end = nodes[waiting, 0], nodes[waiting, 1], nodes[waiting, 2]
        if neighbours.axes[node] < 0:
            leaves += 1
            for row in range(begin, end):
                square = 0.0
                for j in range(d):
                    difference = inputs[row, j] - at[j]
                    square += difference * difference
                if square < squares[found - 1]:
                    place = found - 1
                    while place > 0 and square < squares[place - 1]:
                        squares[place], chosen[place] = squares[place - 1], chosen[place - 1]
                        place -= 1
                    squares[place], chosen[place] = square, row
            continue
        axis = neighbours.axes[node]
        middle = (begin + end) // 2
        beyond = at[axis] - neighbours.cuts[node]
        own = aside[waiting, axis]
        # the farther half waits below the nearer one
        farther, nearer = 2 * node + 1, 2 * node + 2
        far_begin, far_end, near_begin, near_end = begin, middle, middle, end
        if beyond < 0.0:
            farther, nearer = nearer, farther
            far_begin, far_end, near_begin, near_end = middle, end, begin, middle
        above = waiting + 1
        for j in range(d):
            aside[above, j] = aside[waiting, j]
        nodes[above, 0], nodes[above, 1], nodes[above, 2], bounds[above] = nearer, near_begin, near_end, bound
        square = beyond * beyond
        aside[waiting, axis] = square
        nodes[waiting, 0], nodes[waiting, 1], nodes[waiting, 2] = farther, far_begin, far_end
        bounds[waiting] = bound - own + square
        waiting += 2
    return chosen
