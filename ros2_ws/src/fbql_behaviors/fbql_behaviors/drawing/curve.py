"""A curve and a level to compare it with: the learning curve of an induction beside the optimum."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import takewhile
from math import isfinite, log2

from fbql_behaviors.drawing.colours import CURVE, LEVEL
from fbql_behaviors.drawing.svg import Axis, document, frame, line, multiples, number, text, ticks_between

WIDTH, HEIGHT = 560.0, 240.0
LEFT, TOP, RIGHT, BELOW = 64.0, 34.0, 120.0, 48.0
MAX_POINTS = 1000


def curve_svg(
    title: str,
    points: Sequence[tuple[float, float]],
    x_label: str,
    y_label: str,
    level: tuple[str, float] | None = None,
    doubling: bool = False,
) -> str:
    """The curve through points (x, y), as an SVG document; `level` is a name and the y of a dashed line.

    The curve ends before the first y that is not finite; with fewer than two points only the level is drawn. `doubling`
    makes x logarithmic with ticks at powers of 2; x must be positive then.
    """
    finite = [(log2(x) if doubling else x, y) for x, y in takewhile(lambda point: isfinite(point[1]), points)]
    shown = [finite[k * len(finite) // MAX_POINTS] for k in range(MAX_POINTS)] if len(finite) > MAX_POINTS else finite
    if finite and len(finite) > MAX_POINTS:
        shown.append(finite[-1])
    heights = [y for _, y in shown] + ([level[1]] if level is not None else [])
    lowest, highest = min(heights, default=0.0), max(heights, default=1.0)
    margin = (highest - lowest) * 0.08 or max(abs(highest) * 0.1, 0.1)
    low, high = lowest - margin, highest + margin
    first, last = (shown[0][0], shown[-1][0]) if len(shown) > 1 else (0.0, 1.0)
    ticks = multiples(1.0, first, last) if doubling else ticks_between(first, last)
    numbers = tuple(f"{2.0**tick:g}" for tick in ticks) if doubling else ()
    across = Axis(x_label, first, last, LEFT, LEFT + WIDTH, ticks, numbers)
    up = Axis(y_label, low, high, TOP + HEIGHT, TOP, ticks_between(low, high, 4))
    parts = [text(LEFT, 20, title, "start", 14), *frame(across, up)]
    if level is not None:
        name, value = level
        y = up.at(value)
        parts.append(line(LEFT, y, LEFT + WIDTH, y, LEVEL, 'stroke-width="1.5" stroke-dasharray="6 4"'))
        parts.append(text(LEFT + WIDTH + 8, y + 4, name, "start", fill=LEVEL))
    if len(shown) > 1:
        path = " ".join(f"{number(across.at(x))},{number(up.at(y))}" for x, y in shown)
        parts.append(f'<polyline points="{path}" fill="none" stroke="{CURVE}" stroke-width="2"/>')
    return document(LEFT + WIDTH + RIGHT, TOP + HEIGHT + BELOW, title, parts)
