"""Section II.A.1 by the letter, as slowly as it reads: every box looks at every pattern again, nothing is shared or rounded.

It follows the paper's equations only, and uses nothing of the package under test.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import log
from typing import NamedTuple

Row = tuple[float, float, int]
"""Two attributes and a class."""
Box = tuple[tuple[int, int], ...]
"""Of each feature: how often its range was halved, and which of the 2**halvings parts it is."""


class Limits(NamedTuple):
    """What a problem depends on beside its patterns."""

    ranges: tuple[tuple[float, float], ...]
    objective: str
    split_cost: float
    discount: float
    min_range: float
    min_patterns: int
    min_half_patterns: int
    max_entropy: float


def entropy_of(classes: Sequence[int]) -> float:
    """Eq. 2."""
    total = 0.0
    for each in set(classes):
        p = classes.count(each) / len(classes)
        total -= p * log(p)
    return total


def gain_of(classes: Sequence[int], left: Sequence[int], right: Sequence[int]) -> float:
    """Eq. 1."""
    n = len(classes)
    return entropy_of(classes) - (len(left) / n * entropy_of(left) + len(right) / n * entropy_of(right))


def root(limits: Limits) -> Box:
    """The whole state space."""
    return ((0, 0),) * len(limits.ranges)


def bounds(box: Box, limits: Limits) -> list[tuple[float, float]]:
    """The half-open ranges of a box."""
    return [
        (low + (high - low) * (part / 2**level), low + (high - low) * ((part + 1) / 2**level))
        for (level, part), (low, high) in zip(box, limits.ranges, strict=True)
    ]


def inside(box: Box, rows: Sequence[Row], limits: Limits) -> list[int]:
    """The classes of the patterns with x_min <= x < x_max in every dimension."""
    edges = bounds(box, limits)
    return [row[-1] for row in rows if all(low <= row[k] < high for k, (low, high) in enumerate(edges))]


def halves(box: Box, feature: int) -> tuple[Box, Box]:
    """The two children of a half-split."""
    level, part = box[feature]
    before, after = box[:feature], box[feature + 1 :]
    return (*before, (level + 1, 2 * part), *after), (*before, (level + 1, 2 * part + 1), *after)


def splits(box: Box, rows: Sequence[Row], limits: Limits) -> list[tuple[float, Box, Box]]:
    """The half-splits that the four stop criteria leave: eq. 3's reward, and the two children."""
    classes = inside(box, rows, limits)
    if len(classes) < limits.min_patterns or entropy_of(classes) <= limits.max_entropy:
        return []
    found: list[tuple[float, Box, Box]] = []
    for feature in range(len(box)):
        if 0.5 ** (box[feature][0] + 1) < limits.min_range:
            continue
        children = halves(box, feature)
        left, right = (inside(child, rows, limits) for child in children)
        if min(len(left), len(right)) < limits.min_half_patterns:
            continue
        gain = gain_of(classes, left, right)
        if limits.objective == "weighted":
            gain *= len(classes) / len(rows)
        found.append((limits.split_cost + gain, *children))
    return found


def values(rows: Sequence[Row], limits: Limits) -> dict[Box, float]:
    """max_a Q*(s, a) of every box that splits can reach from the root."""
    known: dict[Box, float] = {}

    def value(box: Box) -> float:
        if box not in known:
            best = 0.0  # the no-split action
            for reward, left, right in splits(box, rows, limits):
                successors = value(left) + value(right)
                if limits.objective == "printed":
                    successors /= 2
                best = max(best, reward + limits.discount * successors)
            known[box] = best
        return known[box]

    value(root(limits))
    return known
