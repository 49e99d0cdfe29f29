"""Every non-empty box that half-splits can make of the root region, with the entropy of its patterns and its splits.

Many orders of splitting lead to the same box, so each box is stored once. A box has a level per feature (how often that
feature was halved) and an index per feature; boxes of equal levels form a grid. Only grids that the smallest range allows
exist, and of a grid only the boxes that hold patterns.

The tables are flat: box b, feature i. They are computed grid by grid with NumPy, which takes a few milliseconds for 1000
patterns and grows nearly linearly, because patterns of the same finest cell and class are merged first.

Sums of entropies are rounded to 12 digits: NumPy's sums may differ in the last bit between processors, and a tree must not.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from math import log

import numpy as np
import numpy.typing as npt
from fbql_common.core.errors import BadInput

from fbql_behaviors.core.patterns import Patterns

Ints = npt.NDArray[np.int64]
Floats = npt.NDArray[np.float64]

MAX_GRIDS = 4096
MAX_HALVINGS = 50
"""Limit of the halvings of all features together: a cell and a class must fit a 64-bit number."""


@dataclass(frozen=True)
class Boxes:
    """All non-empty boxes; box 0 is the root.

    levels: int [b, d], halvings of each feature. index: int [b, d], position in the grid.
    count: int [b], patterns. entropy: float [b], eq. 2 [nat].
    left, right: int [b, d], the halves along each feature; -1 where the range is too small or the half is empty.
    grids: (start, stop) of each grid's boxes, coarse before fine: every child stands after its parent.
    """

    levels: Ints
    index: Ints
    count: Ints
    entropy: Floats
    left: Ints
    right: Ints
    grids: tuple[tuple[int, int], ...]

    def __len__(self) -> int:
        return len(self.count)


def edge(low: float, high: float, share: float) -> float:
    """The point at a share of a range; cells and thresholds both use it, so they agree to the last bit."""
    return low + (high - low) * share


def find_boxes(patterns: Patterns, halvings: tuple[int, ...]) -> Boxes:
    """The boxes of the patterns when feature i can be halved `halvings[i]` times.

    A pattern outside the root region counts as lying at its edge. Raises BadInput when there would be too many grids.
    """
    if np.prod([h + 1.0 for h in halvings]) > MAX_GRIDS or sum(halvings) > MAX_HALVINGS:
        raise BadInput(f"half-splits down to {halvings} halvings make too many regions; raise min_range")
    cells = _finest_cells(patterns, halvings)
    cells, classes, weight = _merge(cells, patterns.wheel_class, halvings)
    n_classes = int(classes.max()) + 1
    k_ln_k = _k_ln_k(weight)

    grids = sorted(product(*(range(h + 1) for h in halvings)), key=sum)
    keys_of: dict[tuple[int, ...], Ints] = {}
    start_of: dict[tuple[int, ...], int] = {}
    spans: list[tuple[int, int]] = []
    parts: list[tuple[Ints, Ints, Ints, Floats]] = []
    start = 0
    for levels in grids:
        index = cells >> np.array([h - k for h, k in zip(halvings, levels, strict=True)])
        keys, box = np.unique(_key(index, halvings), return_inverse=True)
        count, entropy = _entropies(box, classes, weight, len(keys), n_classes, k_ln_k)
        keys_of[levels], start_of[levels] = keys, start
        parts.append((np.tile(np.array(levels), (len(keys), 1)), _unkey(keys, halvings), count, entropy))
        spans.append((start, start + len(keys)))
        start += len(keys)

    levels_all, index_all = np.concatenate([p[0] for p in parts]), np.concatenate([p[1] for p in parts])
    left, right = np.full(index_all.shape, -1), np.full(index_all.shape, -1)
    for levels, (begin, end) in zip(grids, spans, strict=True):
        for feature in range(len(halvings)):
            if levels[feature] == halvings[feature]:
                continue
            finer = (*levels[:feature], levels[feature] + 1, *levels[feature + 1 :])
            child = index_all[begin:end].copy()
            child[:, feature] *= 2
            left[begin:end, feature] = _look_up(keys_of[finer], start_of[finer], _key(child, halvings))
            child[:, feature] += 1
            right[begin:end, feature] = _look_up(keys_of[finer], start_of[finer], _key(child, halvings))
    return Boxes(
        levels_all,
        index_all,
        np.concatenate([p[2] for p in parts]),
        np.concatenate([p[3] for p in parts]),
        left,
        right,
        tuple(spans),
    )


def _finest_cells(patterns: Patterns, halvings: tuple[int, ...]) -> Ints:
    columns: list[Ints] = []
    for column, feature in enumerate(patterns.features):
        parts = 1 << halvings[column]
        inner = [edge(feature.low, feature.high, k / parts) for k in range(1, parts)]
        columns.append(np.searchsorted(inner, patterns.x[:, column], side="right"))
    return np.stack(columns, axis=1)


def _merge(cells: Ints, classes: Ints, halvings: tuple[int, ...]) -> tuple[Ints, Ints, Ints]:
    """One row for all patterns of a cell and class, with their number; classes are renumbered from 0."""
    _, dense = np.unique(classes, return_inverse=True)
    n_classes = int(dense.max()) + 1
    keys, weight = np.unique(_key(cells, halvings) * n_classes + dense, return_counts=True)
    return _unkey(keys // n_classes, halvings), keys % n_classes, weight


def _key(index: Ints, halvings: tuple[int, ...]) -> Ints:
    key = np.zeros(len(index), np.int64)
    for column, bits in enumerate(halvings):
        key = (key << bits) | index[:, column]
    return key


def _unkey(key: Ints, halvings: tuple[int, ...]) -> Ints:
    columns: list[Ints] = []
    for bits in reversed(halvings):
        columns.append(key & ((1 << bits) - 1))
        key = key >> bits
    return np.stack(columns[::-1], axis=1)


def _look_up(keys: Ints, start: int, wanted: Ints) -> Ints:
    place = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
    return np.where(keys[place] == wanted, place + start, -1)


def _k_ln_k(weight: Ints) -> Floats:
    return np.array([k * log(k) if k else 0.0 for k in range(int(weight.sum()) + 1)])


def _entropies(
    box: Ints, classes: Ints, weight: Ints, n_boxes: int, n_classes: int, k_ln_k: Floats
) -> tuple[Ints, Floats]:
    """Count and entropy (eq. 2) of each box: -sum p ln p = ln n - (sum k ln k) / n, with k patterns of a class."""
    pairs, pair = np.unique(box * n_classes + classes, return_inverse=True)
    of_class = np.bincount(pair, weights=weight).astype(np.int64)
    count = np.bincount(box, weights=weight, minlength=n_boxes).astype(np.int64)
    sums = np.bincount(pairs // n_classes, weights=k_ln_k[of_class], minlength=n_boxes)
    return count, np.round((k_ln_k[count] - sums) / count, 12) + 0.0
