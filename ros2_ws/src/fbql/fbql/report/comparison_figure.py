"""Runs compared in a figure: one row per group, one dot per run, a bar for all runs of the group with its interval."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite

from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fbql.pictures.style import BLUE, STYLE, svg_bytes, text
from fbql.report.comparison import MEASURES, Group

TITLES = {
    "success_rate": "success rate",
    "cost_per_goal": "steps per goal",
    "own_goals_per_episode": "own goals per episode",
    "collisions_per_episode": "collisions per episode",
}
KEY = "circle: one run; bar: all runs of a group, with its 95 % interval if there are several"


def comparison_svg(groups: Sequence[Group]) -> bytes:
    """The figure as SVG."""
    with rc_context(STYLE):
        height = 1.3 + 0.35 * len(groups) + 0.18 * (len(groups) + 1)
        figure = Figure((11.0, height), layout="constrained")
        for axes, measure in zip(figure.subplots(1, len(MEASURES), sharey=True), MEASURES, strict=True):
            _draw(axes, groups, measure)
        axes = figure.axes[0]
        axes.set_yticks(range(len(groups)), [group.letter for group in groups])
        axes.set_ylim(len(groups) - 0.5, -0.5)
        lines = [*(f"{group.letter}: {group.label}" for group in groups), KEY]
        figure.supxlabel("\n".join(map(text, lines)), x=0.01, ha="left", fontsize=8)
        return svg_bytes(figure)


def _draw(axes: Axes, groups: Sequence[Group], measure: str) -> None:
    for row, group in enumerate(groups):
        interval = group.interval(measure)
        if interval is None:
            axes.annotate("n/a", (0.5, row), xycoords=("axes fraction", "data"), ha="center", va="center")
            continue
        if isfinite(interval.low) and isfinite(interval.high):
            axes.plot([interval.low, interval.high], [row, row], "-|", color="black", ms=8)
        values = [value for run in group.runs if (value := run.ratio(measure)) is not None]
        axes.scatter(
            values,
            [row] * len(values),
            s=30,
            color=BLUE,
            alpha=0.4,
            edgecolors=BLUE,
            gid=f"runs_{group.letter}_{measure}",
        )
        axes.plot([interval.estimate], [row], "|", color="black", ms=16, mew=2.5)
    axes.set_xlabel(TITLES[measure])
    axes.set_xlim(left=0.0, right=1.02 if measure == "success_rate" else None)
    axes.grid(axis="x", lw=0.4)
