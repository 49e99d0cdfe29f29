"""The partition of a tree as a picture: each leaf's region in the colour of its motion, with the patterns on top (Fig. 3).

Two features make the picture of the whole tree, one feature a strip. Of more features, each pair gets a cut through the
tree, at the middle of the root region along the others.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from math import degrees

import numpy as np
import numpy.typing as npt

from fbql_behaviors.core.explanation import Motion, Rule, rules
from fbql_behaviors.core.observation import Feature
from fbql_behaviors.core.svg import Axis, document, dots, frame, multiples, number, plain, text, ticks_between
from fbql_behaviors.core.tree import Region, Tree

COLOURS = {
    Motion.STAND: "#cfcfcf",
    Motion.FORWARDS: "#3aa655",
    Motion.FORWARDS_LEFT: "#56b4e9",
    Motion.SPIN_LEFT: "#1f5fa8",
    Motion.BACKWARDS_LEFT: "#7d5ba6",
    Motion.BACKWARDS: "#6b6b6b",
    Motion.BACKWARDS_RIGHT: "#b0405e",
    Motion.SPIN_RIGHT: "#d9541e",
    Motion.FORWARDS_RIGHT: "#f0b323",
}
"""Left is blue, right is orange, forwards is green; what goes backwards is dark."""
OPACITY = {"slow": 0.45, "": 0.7, "fast": 1.0}
"""How strong the colour is, by speed."""
MAX_POINTS = 3000
MAX_CUTS = 6
WIDTH, HEIGHT, STRIP = 470.0, 400.0, 60.0
LEFT, TOP, BELOW, LEGEND = 64.0, 34.0, 48.0, 200.0


def partition_svg(tree: Tree, x: npt.NDArray[np.float64] | None = None) -> str:
    """The figure of a tree, as an SVG document. `x`: patterns [n, d] to draw, of which 3000 are drawn at most."""
    every = rules(tree)
    regions = tree.regions()
    d = len(tree.features)
    if d <= 2:
        axes = (0, 1) if d == 2 else (0, None)
        shown = list(zip(every, regions, strict=True))
        parts = _panel(tree.features, axes, shown, _thinned(x), TOP)
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
                for rule, region in zip(every, regions, strict=True)
                if all(region[k][0] <= middle[k] < region[k][1] for k in others)
            ]
            parts += _panel(tree.features, pair, cut, [], TOP + sum(heights) + len(heights) * (TOP + BELOW))
            heights.append(HEIGHT)
        title = f"{tree.behavior}: {tree.leaf_count} leaves; cuts through the middle of the other features"
        if len(pairs) > MAX_CUTS:
            title += f" ({MAX_CUTS} of {len(pairs)} pairs)"
    right = LEFT + WIDTH + 20.0
    legend = _legend(every, right, TOP + 8.0)
    width = right + LEGEND
    height = max(sum(heights) + len(heights) * (TOP + BELOW), TOP + 24.0 * (len(legend) // 2 + 1))
    return document(width, height, title, [text(LEFT, 20, title, "start", 14), *parts, *legend])


def _thinned(x: npt.NDArray[np.float64] | None) -> list[tuple[float, ...]]:
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
    """One diagram: regions, patterns, frame. Without a second feature it is a strip."""
    first, second = axes
    across = _axis(features[first], LEFT, LEFT + WIDTH)
    strip = Axis("", 0.0, 1.0, top + STRIP, top, ())
    up = strip if second is None else _axis(features[second], top + HEIGHT, top)
    parts: list[str] = []
    for rule, region in shown:
        low, high = _drawn(features[first], region[first])
        bottom, height = (0.0, 1.0) if second is None else _drawn(features[second], region[second])
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
                _inside(features[first], point[first]),
                0.5 if second is None else _inside(features[second], point[second]),
            )
            for point in points
        ]
        parts.append(dots(across, up, places))
    return parts + frame(across, up)


def _axis(feature: Feature, begin: float, end: float) -> Axis:
    low, high = _drawn(feature, (feature.low, feature.high))
    is_angle = feature.unit == "rad"
    ticks = multiples(45.0, low, high) if is_angle and high - low > 120.0 else ticks_between(low, high)
    unit = "degrees" if is_angle else feature.unit
    return Axis(f"{feature.name.replace('_', ' ')}{f' [{unit}]' if unit else ''}", low, high, begin, end, ticks)


def _drawn(feature: Feature, interval: tuple[float, float]) -> tuple[float, float]:
    """An interval in the unit of the axis: angles are drawn in degrees."""
    low, high = interval
    return (degrees(low), degrees(high)) if feature.unit == "rad" else (low, high)


def _inside(feature: Feature, value: float) -> float:
    """A value in the unit of the axis; what is outside of the root region is drawn at its edge."""
    value = min(max(value, feature.low), feature.high)
    return degrees(value) if feature.unit == "rad" else value


def _legend(every: Sequence[Rule], left: float, top: float) -> list[str]:
    """The motions that the tree knows."""
    used = {rule.motion for rule in every}
    parts: list[str] = []
    for row, motion in enumerate(motion for motion in Motion if motion in used):
        y = top + 24.0 * row
        parts.append(
            f'<rect x="{number(left)}" y="{number(y)}" width="16" height="16" rx="3" fill="{COLOURS[motion]}"/>'
        )
        parts.append(text(left + 24, y + 13, motion.value, "start"))
    parts.append(text(left, top + 24.0 * len(used) + 13, "paler: slower", "start", fill="#777"))
    return parts
