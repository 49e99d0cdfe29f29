"""A picture of which parts of the root region were demonstrated, and which ones play needs."""

from __future__ import annotations

from fbql_behaviors.core.coverage import CELLS, NEEDED, SHOWN, Coverage
from fbql_behaviors.drawing.partition import axis_of
from fbql_behaviors.drawing.svg import Axis, document, frame, number, text

WIDTH, HEIGHT, STRIP = 470.0, 400.0, 60.0
LEFT, TOP, BELOW, LEGEND = 64.0, 34.0, 48.0, 250.0
_LOOKS = {
    SHOWN: ("#56b4e9", "demonstrated"),
    NEEDED: ("#d9541e", "driven in, not demonstrated: missing"),
    ".": ("#eeeeee", "neither"),
}


def coverage_svg(coverage: Coverage) -> str:
    """The grid as an SVG document; empty for more than two features."""
    lines = coverage.map()
    if not lines:
        return ""
    height = HEIGHT if len(coverage.features) == 2 else STRIP
    across = axis_of(coverage.features[0], LEFT, LEFT + WIDTH)
    up = (
        axis_of(coverage.features[1], TOP + height, TOP)
        if len(coverage.features) == 2
        else Axis("", 0, 1, TOP, TOP, ())
    )
    wide, high = WIDTH / CELLS, height / len(lines)
    title = "What was demonstrated, and what play needs"
    parts = [text(LEFT, 20, title, "start", 14)]
    for row, line in enumerate(lines):
        for column, mark in enumerate(line):
            left, top = LEFT + column * wide, TOP + row * high
            parts.append(_box(left, top, wide, high, mark))
            if mark == NEEDED:  # never a colour alone
                parts.append(text(left + wide / 2, top + high / 2 + 5, NEEDED, size=16, fill="#fff"))
    parts += frame(across, up)
    for row, (mark, (_, words)) in enumerate(_LOOKS.items()):
        top = TOP + 8.0 + 24.0 * row
        parts += [_box(LEFT + WIDTH + 20, top, 16, 16, mark), text(LEFT + WIDTH + 44, top + 13, words, "start")]
    return document(LEFT + WIDTH + 44 + LEGEND, TOP + height + BELOW, title, parts)


def _box(left: float, top: float, width: float, height: float, mark: str) -> str:
    size = f'x="{number(left)}" y="{number(top)}" width="{number(width)}" height="{number(height)}"'
    return f'<rect {size} fill="{_LOOKS[mark][0]}" stroke="#fff" stroke-width=".6"/>'
