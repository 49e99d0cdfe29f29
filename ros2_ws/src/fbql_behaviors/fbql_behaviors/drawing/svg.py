"""The few parts of SVG that figures are made of: text, lines, a frame with ticks."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from math import ceil, floor, log10
from typing import NamedTuple

from fbql_behaviors.drawing.colours import FRAME, INK

STEPS = (1.0, 2.0, 5.0, 10.0)


class Axis(NamedTuple):
    """A number line drawn from pixel `begin` to pixel `end`; `low` is drawn at `begin`."""

    label: str
    low: float
    high: float
    begin: float
    end: float
    ticks: tuple[float, ...]
    numbers: tuple[str, ...] = ()
    """Labels of the ticks; by default their values."""

    def at(self, value: float) -> float:
        """The pixel of a value."""
        return self.begin + (value - self.low) / (self.high - self.low) * (self.end - self.begin)


def ticks_between(low: float, high: float, count: int = 6) -> tuple[float, ...]:
    """About `count` round values inside a range."""
    raw = (high - low) / count
    power = 10.0 ** floor(log10(raw))
    step = next(factor * power for factor in STEPS if factor * power >= raw * (1.0 - 1e-9))
    return multiples(step, low, high)


def multiples(step: float, low: float, high: float) -> tuple[float, ...]:
    """The multiples of a step inside a range."""
    first, last = ceil(low / step - 1e-9), floor(high / step + 1e-9)
    return tuple(k * step for k in range(first, last + 1))


def number(value: float) -> str:
    """A coordinate as text, to a hundredth of a pixel."""
    return f"{value:.2f}".rstrip("0").rstrip(".")


def plain(content: str) -> str:
    """A text escaped for XML, without the characters that XML forbids."""
    return escape("".join(character if character.isprintable() else " " for character in content))


def text(x: float, y: float, content: str, anchor: str = "middle", size: int = 12, fill: str = INK) -> str:
    """A text at a place; `anchor` is start, middle or end."""
    where = f'x="{number(x)}" y="{number(y)}"'
    return f'<text {where} text-anchor="{anchor}" font-size="{size}" fill="{fill}">{plain(content)}</text>'


def line(x1: float, y1: float, x2: float, y2: float, stroke: str = FRAME, extra: str = "") -> str:
    """A straight line."""
    ends = " ".join(
        f'{name}="{number(value)}"' for name, value in zip(("x1", "y1", "x2", "y2"), (x1, y1, x2, y2), strict=True)
    )
    return f'<line {ends} stroke="{stroke}"{f" {extra}" if extra else ""}/>'


def frame(x: Axis, y: Axis) -> list[str]:
    """The frame of a diagram, with ticks and labels on its left and lower sides."""
    left, right = sorted((x.begin, x.end))
    top, bottom = sorted((y.begin, y.end))
    parts = [
        f'<rect x="{number(left)}" y="{number(top)}" width="{number(right - left)}" '
        f'height="{number(bottom - top)}" fill="none" stroke="{FRAME}"/>'
    ]
    for value, label in _labelled(x):
        parts += [line(x.at(value), bottom, x.at(value), bottom + 5), text(x.at(value), bottom + 18, label)]
    for value, label in _labelled(y):
        parts += [line(left - 5, y.at(value), left, y.at(value)), text(left - 8, y.at(value) + 4, label, "end")]
    parts.append(text((left + right) / 2, bottom + 38, x.label, size=13))
    if y.label:
        place = f"{number(left - 44)} {number((top + bottom) / 2)}"
        parts.append(f'<g transform="translate({place}) rotate(-90)">{text(0, 0, y.label, size=13)}</g>')
    return parts


def _labelled(axis: Axis) -> list[tuple[float, str]]:
    return list(zip(axis.ticks, axis.numbers or [f"{value:g}" for value in axis.ticks], strict=True))


def dots(x: Axis, y: Axis, points: Sequence[tuple[float, float]]) -> str:
    """Many small dots, as one path."""
    path = "".join(f"M{x.at(first):.1f} {y.at(second):.1f}h0" for first, second in points)
    return (
        f'<path d="{path}" stroke="#000" stroke-opacity=".6" stroke-width="2.2" '
        'stroke-linecap="round" pointer-events="none"/>'
    )


def document(width: float, height: float, title: str, parts: Sequence[str]) -> str:
    """A complete SVG document, to stand alone or inside an HTML page."""
    size = f'width="{number(width)}" height="{number(height)}" viewBox="0 0 {number(width)} {number(height)}"'
    head = f'<svg xmlns="http://www.w3.org/2000/svg" {size} role="img" font-family="system-ui, sans-serif">'
    return "\n".join((head, f"<title>{plain(title)}</title>", *parts, "</svg>")) + "\n"
