"""Random trees and patterns for Hypothesis, with points on thresholds as often as beside them."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf, nextafter, pi

from fbql_behaviors.core.observation import Feature
from fbql_behaviors.core.patterns import Patterns, patterns_from_rows
from fbql_behaviors.core.tree import Leaf, Node, Region, Split, Tree, split_region
from hypothesis import strategies as st

FEATURES = (Feature("ball_distance", "m", 0.0, 3.2), Feature("ball_bearing", "rad", -pi, pi))
WHEEL = st.floats(-88.0, 88.0)
NASTY = '*/ "\\ %s\n\0<script>&</script> é'
"""A name that could break out of a C comment, a DOT string or an SVG text."""
PLANE = (Feature("distance", "m", 0.0, 3.2), Feature("bearing", "rad", -3.0, 3.0))
"""Two features for patterns; quarters of their ranges are frequent in the strategies, so that patterns lie on splits."""
DISTANCES = st.one_of(st.sampled_from([0.0, 0.4, 0.8, 1.6, 2.4]), st.floats(0.0, 3.19))
BEARINGS = st.one_of(st.sampled_from([-3.0, -1.5, 0.0, 0.75, 1.5]), st.floats(-3.0, 2.99))
Row = tuple[float, float, int]
"""Distance, bearing and class of a pattern."""


def rows(classes: Sequence[int], max_size: int) -> st.SearchStrategy[list[Row]]:
    """Rows of patterns in PLANE."""
    return st.lists(st.tuples(DISTANCES, BEARINGS, st.sampled_from(classes)), min_size=1, max_size=max_size)


def patterns_of_rows(rows: Sequence[Row]) -> Patterns:
    """The patterns of rows in PLANE."""
    return patterns_from_rows(PLANE, [row[:2] for row in rows], [row[2] for row in rows])


@st.composite
def trees(draw: st.DrawFn, features: tuple[Feature, ...] = FEATURES, depth: int = 5) -> Tree:
    """A tree of up to 2^depth leaves, with thresholds anywhere."""
    nodes: list[Node] = []
    leaves: list[Leaf] = []

    def grow(region: Region, left: int) -> int:
        place = len(nodes)
        nodes.append(0)
        column = draw(st.integers(0, len(features) - 1))
        low, high = region[column]
        if left == 0 or high - low < 0.01 or draw(st.booleans()):
            nodes[place] = len(leaves)
            leaves.append(Leaf(draw(WHEEL), draw(WHEEL), draw(st.integers(0, 99))))
            return place
        threshold = low + (high - low) * draw(st.floats(0.1, 0.9))
        below, above = split_region(region, column, threshold)
        nodes[place] = Split(column, threshold, grow(below, left - 1), grow(above, left - 1))
        return place

    grow(tuple((feature.low, feature.high) for feature in features), depth)
    return Tree("random", features, tuple(nodes), tuple(leaves))


def edge_points(tree: Tree) -> list[tuple[float, ...]]:
    """For each split a point on it, one just below and one just above it; the other features are in the middle."""
    middle = [(feature.low + feature.high) / 2 for feature in tree.features]
    points: list[tuple[float, ...]] = [tuple(middle)]
    for node in tree.nodes:
        if isinstance(node, Split):
            near = (node.threshold, nextafter(node.threshold, -inf), nextafter(node.threshold, inf))
            points += [(*middle[: node.feature], value, *middle[node.feature + 1 :]) for value in near]
    return points


def points_of(features: tuple[Feature, ...] = FEATURES) -> st.SearchStrategy[tuple[float, ...]]:
    """Points inside and around the root region."""
    return st.tuples(*(st.floats(feature.low - 1.0, feature.high + 1.0) for feature in features))
