"""Extremely randomized trees (extra-trees; Geurts, Ernst & Wehenkel 2006, Machine Learning 63): regression with several outputs.

Every tree sees all rows. A node draws one threshold for each input between its least and its largest value there, and splits
at the one that explains most of the outputs' variance. The prediction of one tree drawn at random has the spread of the data.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from fbql_common.core.kernels import kernel, kernel_for
from numpy.typing import NDArray

from fbql_fusion.core.learners.linear import Floats

_LEAF = -1


class Forest(NamedTuple):
    """K trees over d inputs with m outputs. The left child of a split is the next node."""

    roots: NDArray[np.int64]
    """[K]; empty if there was too little to fit."""
    nodes: Floats
    """The input that a node splits on, the threshold below which rows go to the left, and the right child; of a leaf -1, 0, and
    its row of `outputs`, [nodes, 3]. One array, since a walk waits for memory."""
    outputs: Floats
    """[leaves, m]"""


def no_forest(outputs: int) -> Forest:
    """A forest that predicts nothing."""
    return Forest(np.empty(0, dtype=np.int64), np.empty((0, 3)), np.empty((0, outputs)))


@kernel
def leaf_of(forest: Forest, tree: int, x: Floats) -> int:
    """The row of `outputs` that one tree predicts for the inputs x, [d]."""
    nodes = forest.nodes
    node = forest.roots[tree]
    while nodes[node, 0] >= 0.0:
        node = node + 1 if x[int(nodes[node, 0])] < nodes[node, 1] else int(nodes[node, 2])
    return int(nodes[node, 2])


def _sums_interpreted(
    x: Floats, y: Floats, rows: NDArray[np.int64], thresholds: Floats
) -> tuple[NDArray[np.int64], Floats]:
    goes_right = x[rows] >= thresholds
    d, m = len(thresholds), y.shape[1]
    sums = np.zeros((m, d))
    for j in range(d):
        for k in range(m):
            sums[k, j] = np.bincount(goes_right[:, j], weights=y[rows, k], minlength=2)[1]  # one by one, in order
    return goes_right.sum(axis=0), sums


@kernel_for(_sums_interpreted)
def sums_to_the_right(
    x: Floats, y: Floats, rows: NDArray[np.int64], thresholds: Floats
) -> tuple[NDArray[np.int64], Floats]:
    """The rows to the right of each input's threshold: their number, [d], and the sum of each output, [m, d].

    Args:
        x, y: of all rows.
        rows: those of the node, [N].
        thresholds: [d].
    """
    d, m = len(thresholds), y.shape[1]
    counts = np.zeros(d)
    sums = np.zeros((m, d))
    is_right = np.empty(d)
    for i in range(len(rows)):
        own_x, own_y = x[rows[i]], y[rows[i]]
        for j in range(d):
            is_right[j] = 1.0 if own_x[j] >= thresholds[j] else 0.0
            counts[j] += is_right[j]
        for k in range(m):
            value = own_y[k]
            for j in range(d):
                sums[k, j] += is_right[j] * value
    return counts.astype(np.int64), sums


@kernel
def split_gains(total: Floats, rows: int, counts: NDArray[np.int64], sums: Floats, least: int) -> Floats:
    """Eq. 22: how much of the outputs' variance each split explains: sum_k S_k^2 / N of the left part and of the right part.

    S_k is the sum of output k over a part, N the number of its rows.

    Args:
        total: sum of each output over the node, [m].
        rows: number of its rows.
        counts: rows to the right of each split, [d].
        sums: sums of the outputs there, [m, d].
        least: least number of rows in a part.

    Returns:
        [d]; -1 for a split with too small a part.
    """
    gains = np.full(len(counts), -1.0)
    for j in range(len(counts)):
        right = counts[j]
        left = rows - right
        if left >= least and right >= least:
            gain = 0.0
            for k in range(len(total)):
                of_left = total[k] - sums[k, j]
                gain += of_left * of_left / left + sums[k, j] * sums[k, j] / right
            gains[j] = gain
    return gains


def _total_interpreted(y: Floats, rows: NDArray[np.int64]) -> Floats:
    return np.cumsum(y[rows], axis=0)[-1] + 0.0  # one by one, in order


@kernel_for(_total_interpreted)
def total_of(y: Floats, rows: NDArray[np.int64]) -> Floats:
    """The sum of each output over some rows, [m]."""
    total = np.zeros(y.shape[1])
    for i in range(len(rows)):
        own = y[rows[i]]
        for k in range(len(total)):
            total[k] += own[k]
    return total


def _bounds_interpreted(x: Floats, rows: NDArray[np.int64]) -> tuple[Floats, Floats]:
    own = x[rows]
    return own.min(axis=0), own.max(axis=0)


@kernel_for(_bounds_interpreted)
def bounds_of(x: Floats, rows: NDArray[np.int64]) -> tuple[Floats, Floats]:
    """The least and the largest value of each input in some rows, [d] each."""
    low = x[rows[0]].copy()
    high = low.copy()
    for i in range(1, len(rows)):
        own = x[rows[i]]
        for j in range(len(low)):
            value = own[j]
            low[j] = value if value < low[j] else low[j]
            high[j] = value if value > high[j] else high[j]
    return low, high


def _part_interpreted(x: Floats, rows: NDArray[np.int64], at: int, threshold: float) -> int:
    goes_right = x[rows, at] >= threshold
    rows[:] = np.concatenate([rows[~goes_right], rows[goes_right]])
    return len(rows) - int(goes_right.sum())


@kernel_for(_part_interpreted)
def part(x: Floats, rows: NDArray[np.int64], at: int, threshold: float) -> int:
    """Sorts rows into those that a split sends to the left and, after them, those to the right; each keep their order.

    Returns:
        The number of those to the left.
    """
    right = np.empty(len(rows), dtype=np.int64)
    left = 0
    for i in range(len(rows)):
        row = rows[i]
        if x[row, at] >= threshold:
            right[i - left] = row
        else:
            rows[left] = row
            left += 1
    for i in range(left, len(rows)):
        rows[i] = right[i - left]
    return left


@kernel
def grow_forest(x: Floats, y: Floats, trees: int, least: int, generator: np.random.Generator) -> Forest:
    """Fits a forest.

    Args:
        x: inputs, [N, d], N at least 1.
        y: outputs, [N, m].
        trees: K.
        least: least number of rows in a leaf.
        generator: of the thresholds.
    """
    count, d = x.shape
    most = trees * (2 * (count // least) + 1)
    table = np.zeros((most, 3))
    outputs = np.zeros((most // 2 + trees, y.shape[1]))
    roots = np.zeros(trees, dtype=np.int64)
    draws = np.empty(d)
    nodes = leaves = 0
    pending = np.empty((count + 2, 3), dtype=np.int64)  # the first and last row of a node, and the split above it
    for tree in range(trees):
        roots[tree] = nodes
        order = np.arange(count, dtype=np.int64)
        pending[0, 0], pending[0, 1], pending[0, 2] = 0, count, -1
        waiting = 1
        while waiting:
            waiting -= 1
            begin, end, above = int(pending[waiting, 0]), int(pending[waiting, 1]), int(pending[waiting, 2])
            rows = order[begin:end]
            node = nodes
            nodes += 1
            if above >= 0:
                table[above, 2] = node
            total = total_of(y, rows)
            best = _LEAF
            if len(rows) >= 2 * least:
                low, high = bounds_of(x, rows)
                for j in range(d):
                    draws[j] = low[j] + generator.random() * (high[j] - low[j])
                counts, sums = sums_to_the_right(x, y, rows, draws)
                gains = split_gains(total, len(rows), counts, sums, least)
                best = int(np.argmax(gains))
                if gains[best] < 0.0:
                    best = _LEAF
            if best == _LEAF:
                outputs[leaves] = total / len(rows)
                table[node, 0], table[node, 2] = _LEAF, leaves
                leaves += 1
                continue
            middle = begin + part(x, rows, best, draws[best])
            table[node, 0], table[node, 1] = best, draws[best]
            pending[waiting, 0], pending[waiting, 1], pending[waiting, 2] = middle, end, node
            pending[waiting + 1, 0], pending[waiting + 1, 1], pending[waiting + 1, 2] = begin, middle, -1
            waiting += 2
    return Forest(roots, table[:nodes].copy(), outputs[:leaves].copy())


def fit_forest(x: Floats, y: Floats, trees: int, least: int, generator: np.random.Generator) -> Forest:
    """A forest whose splits weigh every output by its standard deviation; see `grow_forest`. With too few rows for one split
    it predicts nothing."""
    if len(x) < 2 * least:
        return no_forest(y.shape[1])
    mean, scale = y.mean(axis=0), y.std(axis=0)
    scale[scale < 1e-12] = 1.0
    forest = grow_forest(np.ascontiguousarray(x), (y - mean) / scale, trees, least, generator)
    return forest._replace(outputs=forest.outputs * scale + mean)
