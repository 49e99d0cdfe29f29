"""Drawing of the figures of all studies: colors, style, files, and the axes that several of them share.

The colors are those of Okabe and Ito, Color Universal Design (2008), which people with any color vision can tell apart,
and two of Paul Tol's.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping, Sequence
from math import nan
from pathlib import Path
from typing import Any

from fbql.pictures.style import STYLE, svg_bytes
from fbql_common.files import write_atomically
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FormatStrFormatter, LogLocator, NullFormatter

from fbql_studies.common.methods import (
    FBQL,
    FBQL_MODEL,
    FBQL_VALUE,
    LAW,
    PAPER,
    RETUNED,
    SENSED,
    TIES_NONE,
    guided,
    imagined_once,
    papers_guide,
)

Curves = Mapping[str, Any]
"""Name of a figure -> the data that it is drawn from, as plain JSON values."""
CURVES = "curves.json"
BLACK, ORANGE, SKY, GREEN = "#000000", "#E69F00", "#56B4E9", "#009E73"
BLUE, VERMILLION, PURPLE, GREY = "#0072B2", "#D55E00", "#CC79A7", "#888888"
WINE, ROSE = "#882255", "#CC6677"
SERIES = (BLUE, ORANGE, GREEN, PURPLE, VERMILLION, SKY, BLACK, GREY)
COLOURS = {
    FBQL: BLUE,
    SENSED: SKY,
    FBQL_VALUE: ORANGE,
    PAPER: VERMILLION,
    RETUNED: GREEN,
    papers_guide(FBQL): BLACK,
    guided(papers_guide(FBQL)): GREY,
    TIES_NONE: PURPLE,
    LAW: GREY,
    FBQL_MODEL: WINE,
    imagined_once(FBQL_MODEL): ROSE,
}
"""The color of a method."""


def keep_and_draw(figures: Mapping[str, Callable[[Any], Figure]], curves: Curves, directory: Path) -> list[Path]:
    """Writes curves.json and draws the figures of fusion from it; nothing where there are no curves.

    Args:
        figures: name of a figure -> the function that draws it from its curves.
    """
    if not curves:
        return []
    path = directory / CURVES
    write_atomically(path, f"{json.dumps(curves, separators=(',', ':'), allow_nan=False)}\n".encode())
    return [path, *draw(figures, curves, directory)]


def draw(
    figures: Mapping[str, Callable[[Any], Figure]], numbers: Curves, directory: Path, prefix: str = "fusion"
) -> list[Path]:
    """Draws a figure from each entry of `numbers`, as PREFIX_NAME.svg; returns the files."""
    files: list[Path] = []
    with rc_context({**STYLE, "svg.hashsalt": prefix}):
        for name, each in numbers.items():
            files.append(directory / f"{prefix}_{name}.svg")
            write_atomically(files[-1], _shorten(svg_bytes(figures[name](each)).decode()).encode())
    return files


def _shorten(svg: str) -> str:
    """Removes line breaks inside paths, and all but two decimals of numbers from 1 up."""
    return re.sub(r"([1-9]\d*\.\d\d)\d+", r"\1", re.sub(r" ?\n(?=[MLQCz\"])", " ", svg))


def draw_learning(axes: Sequence[Axes], numbers: Mapping[str, Any]) -> None:
    """cost/goal and success rate during training, with frozen controls as dashed lines, each on its axis."""
    labels = {"cost": "steps of all episodes / goals", "success": "success rate"}
    for axis, (measure, label) in zip(axes, labels.items(), strict=True):
        for place, (name, found) in enumerate(numbers["trained"].items()):
            estimate, low, high = (known(line) for line in found[measure])
            colour = COLOURS.get(name, SERIES[place])
            axis.plot(found["episodes"], estimate, color=colour, label=f"{name}, in training")
            axis.fill_between(found["episodes"], low, high, color=colour, alpha=0.2, lw=0)
        for name, found in numbers["controls"].items():
            estimate, low, high = known(found[measure])
            colour = COLOURS.get(name, BLACK)
            axis.axhline(estimate, color=colour, ls="--", label=name)
            axis.axhspan(low, high, color=colour, alpha=0.15, lw=0)
        axis.set_xlabel("training episodes")
        axis.set_title(label, fontsize=9)
        axis.grid(lw=0.4)
        axis.set_xlim(left=0)
    axes[0].set_ylim(bottom=0)
    axes[0].legend(frameon=False)


def known(values: Sequence[float | None]) -> list[float]:
    """The numbers, with NaN for unknown ones."""
    return [nan if x is None else x for x in values]


def intervals_figure(rows: Sequence[Mapping[str, Any]], name: str, label: str) -> Figure:
    """A ratio and its interval for each method, on a logarithmic axis; 1 is the control."""
    figure = Figure((7.0, 0.27 * len(rows) + 0.9), layout="constrained")
    axis = figure.subplots()
    draw_intervals(axis, [(row[name], row[f"{name}_low"], row[f"{name}_high"]) for row in rows])
    use_logarithmic_axis(axis)
    axis.axvline(1.0, color=GREY, lw=0.8)
    axis.set_yticks(range(len(rows)), [row["method"] for row in rows])
    axis.set_ylim(len(rows) - 0.4, -0.6)
    axis.set_xlabel(label)
    return figure


def costs_figure(rows: Sequence[Mapping[str, Any]]) -> Figure:
    """The cost of every variant relative to the default's."""
    return intervals_figure(rows, name="ratio_default", label="cost/goal to the default's")


def draw_intervals(axis: Axes, found: Sequence[Sequence[float | None]]) -> None:
    """Estimates with their low and high ends, one below the other. An interval without a high end is an arrow; an estimate
    without a low one has no interval."""  # fmt: skip
    edge = 2.0 * max((x for each in found for x in each if x is not None), default=1.0)
    for place, (estimate, low, high) in enumerate(found):
        if estimate is not None:
            axis.plot(estimate, place, "o", color=BLUE, ms=4)
        if low is not None:
            axis.plot([low, edge if high is None else high], [place, place], color=BLUE, lw=2)
            if high is None:
                axis.plot(edge, place, ">", color=BLUE, ms=6)
    axis.grid(axis="x", lw=0.4)


def use_logarithmic_axis(axis: Axes) -> None:
    """Makes the x axis logarithmic, with plain numbers at 1, 2 and 5."""
    axis.set_xscale("log")
    low, high = axis.get_xlim()
    axis.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if high < 500.0 * low else (1.0,)))
    axis.xaxis.set_major_formatter(FormatStrFormatter("%g"))
    axis.xaxis.set_minor_formatter(NullFormatter())
