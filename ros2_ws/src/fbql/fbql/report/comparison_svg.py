"""Runs compared as a picture: a row a kind, a dot a run, the ratio over all runs as a bar with its interval."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite

from fbql_behaviors.drawing.svg import Axis, document, frame, line, number, text, ticks_between

from fbql.report.comparison import MEASURES, Kind

TITLES = {
    "success_rate": "success rate",
    "cost_per_goal": "steps for each goal",
    "own_goals_per_episode": "own goals an episode",
    "collisions_per_episode": "collisions an episode",
}
WIDTH, LEFT, GAP, TOP, ROW, BELOW = 210.0, 60.0, 40.0, 34.0, 34.0, 46.0
LINE = 17.0
RUN, MEAN = "#0072b2", "#222"


def picture(kinds: Sequence[Kind]) -> str:
    """The SVG."""
    bottom = TOP + ROW * len(kinds)
    parts: list[str] = []
    for place, measure in enumerate(MEASURES):
        left = LEFT + place * (WIDTH + GAP)
        parts += _panel(kinds, measure, left, bottom)
    for row, kind in enumerate(kinds):
        parts.append(text(LEFT - 14, _middle(row) + 5, kind.letter, "end", 15))
        parts.append(text(LEFT, bottom + BELOW + LINE * (row + 1), f"{kind.letter}: {kind.label}", "start"))
    key = bottom + BELOW + LINE * (len(kinds) + 1.5)
    parts.append(
        text(
            LEFT, key, "circle: a run; bar: all runs of a kind, with its 95 % interval where there are several", "start"
        )
    )
    return document(LEFT + len(MEASURES) * (WIDTH + GAP), key + 14, "Runs compared", parts)


def _panel(kinds: Sequence[Kind], measure: str, left: float, bottom: float) -> list[str]:
    found = [kind.interval(measure) for kind in kinds]
    known = [value for interval in found if interval is not None for value in interval if isfinite(value)]
    known += [value for kind in kinds for run in kind.runs if (value := run.ratio(measure)) is not None]
    high = 1.0 if measure == "success_rate" else 1.05 * max(known, default=1.0) or 1.0
    across = Axis(TITLES[measure], 0.0, high, left, left + WIDTH, ticks_between(0.0, high, 3))
    parts = frame(across, Axis("", 0.0, 1.0, bottom, TOP, ()))
    for row, (kind, interval) in enumerate(zip(kinds, found, strict=True)):
        y = _middle(row)
        if interval is None:
            parts.append(text(left + WIDTH / 2, y + 4, "n/a"))
            continue
        if isfinite(interval.low) and isfinite(interval.high):
            low, end = across.at(interval.low), across.at(interval.high)
            parts.append(line(low, y, end, y, MEAN, 'stroke-width="2"'))
            parts += [line(x, y - 5, x, y + 5, MEAN, 'stroke-width="2"') for x in (low, end)]
        for run in kind.runs:
            value = run.ratio(measure)
            if value is not None:
                x = number(across.at(value))
                parts.append(
                    f'<circle cx="{x}" cy="{number(y)}" r="4.5" fill="{RUN}" fill-opacity=".35" stroke="{RUN}"/>'
                )
        x = across.at(interval.estimate)
        parts.append(line(x, y - 11, x, y + 11, MEAN, 'stroke-width="3"'))
    return parts


def _middle(row: int) -> float:
    return TOP + ROW * (row + 0.5)
