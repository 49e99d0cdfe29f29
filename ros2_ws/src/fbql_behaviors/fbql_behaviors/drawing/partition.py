"""The partition of a tree: each leaf's region in the color of its motion, with the patterns on top (Fig. 3).

A tree of two features is drawn whole, one of a single feature as a strip. With more features, each pair gets a cut
through the tree, at the middle of the root region along the others.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from math import degrees

import numpy as np
import numpy.typing as npt

from fbql_behaviors.core.explanation import Motion, Rule, rules
from fbql_behaviors.core.observation import Feature
from fbql_behaviors.core.tree import Region, Tree
from fbql_behaviors.drawing.colours import COLOURS, FAINT, OPACITY
from fbql_behaviors.drawing.svg import Axis, document, dots, frame, multiples, number, plain, text, ticks_between

MAX_POINTS = 3000
MAX_CUTS = 6
WIDTH, HEIGHT, STRIP = 470.0, 400.0, 60.0
LEFT, TOP, BELOW, LEGEND = 64.0, 34.0, 48.0, 200.0


def partition_svg(tree: Tree, x: npt.NDArray[np.float64] | None = None) -> str:
    """The partition as an SVG document. `x`: patterns [n, d], of which at most 3000 are drawn, evenly taken."""
    leaf_rules = rules(tree)
    regions = tree.regions()
    d = len(tree.features)
    if d <= 2:
        axes = (0, 1) if d == 2 else (0, None)
        shown = list(zip(leaf_rules, regions, strict=True))
        parts = _panel(tree.features, axes, shown, _sample(x), TOP)
        heights = [HEIGHT if d == 2 else STRIP]
        title = f"{tree.behavior}: {tree.leaf_count} leaves"
    else:
        parts: list[str] = []
        heights: list[float] = []
        middle = [(feature.low + feature.high) / 2 for feature in tree.features]
        pairs = list(combinations(range(d), 2))
        for pair in pairs[:MAX_CUTS]:
            others = [k for k in range(d) if k not in pair]
            cut = [
                (rule, region)
                for rule, region in zip(leaf_rules, regions, strict=True)
                if all(region[k][0] <= middle[k] < region[k][1] for k in others)
            ]
            parts += _panel(tree.features, pair, cut, [], TOP + sum(heights) + len(heights) * (TOP + BELOW))
            heights.append(HEIGHT)
        title = f"{tree.behavior}: {tree.leaf_count} leaves; cuts through the middle of the other features"
        if len(pairs) > MAX_CUTS:
            title += f" ({MAX_CUTS} of {len(pairs)} pairs)"
    right = LEFT + WIDTH + 20.0
    legend = _legend(leaf_rules, right, TOP + 8.0)
    width = right + LEGEND
    height = max(sum(heights) + len(heights) * (TOP + BELOW), TOP + 24.0 * (len(legend) // 2 + 1))
    return document(width, height, title, [text(LEFT, 20, title, "start", 14), *parts, *legend])


def _sample(x: npt.NDArray[np.float64] | None) -> list[tuple[float, ...]]:
    if x is None:
        return []
    count = min(len(x), MAX_POINTS)
    return [tuple(x[k * len(x) // count].tolist()) for k in range(count)]


def _panel(
    features: tuple[Feature, ...],
    axes: tuple[int, int | None],
    shown: Sequence[tuple[Rule, Region]],
    points: Sequence[tuple[float, ...]],
    top: float,
) -> list[str]:
    """One diagram: regions, patterns, frame; a strip if there is no second feature."""
    first, second = axes
    across = axis_of(features[first], LEFT, LEFT + WIDTH)
    strip = Axis("", 0.0, 1.0, top + STRIP, top, ())
    up = strip if second is None else axis_of(features[second], top + HEIGHT, top)
    parts: list[str] = []
    for rule, region in shown:
        low, high = in_axis_unit(features[first], region[first])
        bottom, height = (0.0, 1.0) if second is None else in_axis_unit(features[second], region[second])
        left, over = across.at(low), up.at(height)
        box = (left, over, across.at(high) - left, up.at(bottom) - over)
        size = " ".join(
            f'{name}="{number(value)}"' for name, value in zip(("x", "y", "width", "height"), box, strict=True)
        )
        parts.append(
            f'<rect {size} fill="{COLOURS[rule.motion]}" fill-opacity="{OPACITY[rule.speed]}" stroke="#fff" '
            f'stroke-width=".6"><title>leaf {rule.leaf_id}: {plain(rule.sentence)}</title></rect>'
        )
    if points:
        places = [
            (
                _pointin_axis_unit(features[first], point[first]),
                0.5 if second is None else _pointin_axis_unit(features[second], point[second]),
            )
            for point in points
        ]
        parts.append(dots(across, up, places))
    return parts + frame(across, up)


def axis_of(feature: Feature, begin: float, end: float) -> Axis:
    """The axis of a feature over its root range, from pixel `begin` to pixel `end`."""
    low, high = in_axis_unit(feature, (feature.low, feature.high))
    is_angle = feature.unit == "rad"
    ticks = multiples(45.0, low, high) if is_angle and high - low > 120.0 else ticks_between(low, high)
    unit = "degrees" if is_angle else feature.unit
    return Axis(f"{feature.name.replace('_', ' ')}{f' [{unit}]' if unit else ''}", low, high, begin, end, ticks)


def in_axis_unit(feature: Feature, interval: tuple[float, float]) -> tuple[float, float]:
    """An interval in the unit of the axis: degrees for angles."""
    low, high = interval
    return (degrees(low), degrees(high)) if feature.unit == "rad" else (low, high)


def _pointin_axis_unit(feature: Feature, value: float) -> float:
    """A value in the unit of the axis; a value outside the root region is moved to its edge."""
    value = min(max(value, feature.low), feature.high)
    return degrees(value) if feature.unit == "rad" else value


def _legend(leaf_rules: Sequence[Rule], left: float, top: float) -> list[str]:
    """The motions of the tree's leaves, with their colors."""
    used = {rule.motion for rule in leaf_rules}
    parts: list[str] = []
    for row, motion in enumerate(motion for motion in Motion if motion in used):
        y = top + 24.0 * row
        parts.append(
            f'<rect x="{number(left)}" y="{number(y)}" width="16" height="16" rx="3" fill="{COLOURS[motion]}"/>'
        )
        parts.append(text(left + 24, y + 13, motion.value, "start"))
    parts.append(text(left, top + 24.0 * len(used) + 13, "paler: slower", "start", fill=FAINT))
    return parts
