"""What tuning the leaves of a tree changed: each start before and after, and both means with their intervals."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib import rc_context
from matplotlib.figure import Figure

from fbql.pictures.style import BLUE, GREY, ORANGE, STYLE, svg_bytes, text
from fbql.statistics.inference import mean_interval


def tuning_svg(behavior: str, measure: str, before: Sequence[float], after: Sequence[float]) -> bytes:
    """The figure as SVG.

    Args:
        before: the cost of each start, driven by the tree as it was.
        after: the same starts, driven by the tuned tree.
    """
    with rc_context(STYLE):
        figure = Figure((4.6, 3.4), layout="constrained")
        axes = figure.subplots()
        for old, new in zip(before, after, strict=True):
            axes.plot([0, 1], [old, new], "-", color=GREY, lw=0.5, alpha=0.25)
        for place, (values, colour, sign) in enumerate(((before, BLUE, "o"), (after, ORANGE, "s"))):
            mean, low, high = mean_interval(values)
            axes.plot([place] * len(values), values, ".", color=colour, ms=2, alpha=0.4)
            axes.plot([place, place], [low, high], "-|", color="black", ms=8)
            axes.plot([place], [mean], sign, color=colour, mec="black", ms=8, zorder=3)
        axes.set_xlim(-0.4, 1.4)
        axes.set_xticks([0, 1], ["before", "after"])
        axes.set_ylim(bottom=0)
        axes.set_ylabel(text(measure))
        axes.set_title(text(f"{behavior}: {len(before)} starts; means with 95 % intervals"), fontsize=9)
        axes.grid(axis="y", lw=0.4)
        return svg_bytes(figure)
