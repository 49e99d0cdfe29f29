"""The figures of the studies of fusion, drawn from small files of numbers, in the colours of Okabe and Ito."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from io import StringIO
from math import cos, degrees, nan, sin
from pathlib import Path
from typing import Any

import numpy as np
from fbql.statistics.courses import MEASURES
from fbql_common.atomic_file import write_atomically
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import FormatStrFormatter, LogLocator, MaxNLocator, NullFormatter
from numpy.typing import NDArray

from fbql_studies.methods import SENSED

Curves = Mapping[str, Any]
"""Name of a figure -> what it is drawn from, as plain JSON values."""
CURVES = "curves.json"
BLACK, ORANGE, SKY, GREEN = "#000000", "#E69F00", "#56B4E9", "#009E73"
BLUE, VERMILLION, PURPLE, GREY = "#0072B2", "#D55E00", "#CC79A7", "#888888"
SERIES = (BLUE, ORANGE, GREEN, PURPLE, VERMILLION, SKY, BLACK, GREY)
BEHAVIORS = (ORANGE, SKY, PURPLE, GREEN, VERMILLION, BLUE, BLACK, GREY)
"""One a behavior; the first three as in the picture of an episode (ros2_ws/src/fbql/fbql/pictures/episode.py)."""
COLOURS = {
    "fbql": BLUE,
    SENSED: SKY,
    "fbql_value": ORANGE,
    "subsumption, paper": VERMILLION,
    "subsumption, re-tuned": GREEN,
    "fbql, paper's guide": BLACK,
    "fbql, paper's guide, only guided": GREY,
    "fbql literal, ties: none": PURPLE,
    "scripted law, sees all": GREY,
}
STYLE = {
    "font.size": 9,
    "font.sans-serif": ["DejaVu Sans", "Verdana", "Arial"],
    "axes.spines.top": False,
    "axes.spines.right": False,
    "svg.fonttype": "none",
    "svg.hashsalt": "fusion",
}
TITLES = {
    "failures": "failures before a success",
    "steps": "steps of a success (Figs. 10, 12)",
    "all steps": "steps, failures before it included",
    "collisions begun": "collisions begun (Figs. 11, 13)",
    "contact steps": "steps in contact (Figs. 11, 13)",
    "success rate": "success rate (Fig. 14)",
}


def write_curves(curves: Curves, directory: Path) -> Path:
    """Keeps what figures are drawn from."""
    path = directory / CURVES
    write_atomically(path, f"{json.dumps(curves, separators=(',', ':'), allow_nan=False)}\n".encode())
    return path


def draw(curves: Curves, directory: Path) -> list[Path]:
    """Draws every figure that there are numbers for; gives the files."""
    files: list[Path] = []
    with rc_context(STYLE):
        for name, numbers in curves.items():
            text = StringIO()
            FigureCanvasSVG(FIGURES[name](numbers)).print_svg(text, metadata={"Date": None, "Creator": None})
            files.append(directory / f"fusion_{name}.svg")
            files[-1].write_text(_slim(text.getvalue()))
    return files


def _slim(svg: str) -> str:
    """An SVG of Matplotlib without line breaks inside of paths, and with two decimals of what is larger than 1."""
    return re.sub(r"([1-9]\d*\.\d\d)\d+", r"\1", re.sub(r" ?\n(?=[MLQCz\"])", " ", svg))


def paper_figure(numbers: Mapping[str, Any]) -> Figure:
    """The analogues of the paper's Figs. 10 to 14: moving averages over the successes of a run."""
    figure = Figure((9.5, 5.0), layout="constrained")
    axes = figure.subplots(2, 3, sharex=True)
    for axis, measure in zip(axes.flat, MEASURES, strict=True):
        for method, found in numbers.items():
            if measure not in found:
                continue
            mean, low, high = found[measure]
            at = range(found["first"], found["first"] + len(mean))
            colour = COLOURS.get(method, BLACK)
            axis.plot(at, mean, color=colour, label=method)
            axis.fill_between(at, low, high, color=colour, alpha=0.2, lw=0)
        axis.set_title(TITLES[measure], fontsize=9)
        axis.set_ylim(bottom=0)
        axis.grid(lw=0.4)
    for axis in axes[1]:
        axis.xaxis.set_major_locator(MaxNLocator(integer=True))
        axis.set_xlabel("success")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=4, frameon=False)
    return figure


def learning_figure(numbers: Mapping[str, Any]) -> Figure:
    """Success rate and cost of a goal over the course of the training, exploration included."""
    figure = Figure((9.5, 3.4), layout="constrained")
    axes = figure.subplots(1, 2)
    _learning(axes, numbers)
    return figure


def _learning(axes: Sequence[Axes], numbers: Mapping[str, Any]) -> None:
    labels = {"cost": "steps of all episodes / goals", "success": "success rate"}
    for axis, (measure, label) in zip(axes, labels.items(), strict=True):
        for place, (name, found) in enumerate(numbers["trained"].items()):
            estimate, low, high = (_known(line) for line in found[measure])
            colour = COLOURS.get(name, SERIES[place])
            axis.plot(found["episodes"], estimate, color=colour, label=f"{name}, in training")
            axis.fill_between(found["episodes"], low, high, color=colour, alpha=0.2, lw=0)
        for name, found in numbers["controls"].items():
            estimate, low, high = _known(found[measure])
            colour = COLOURS.get(name, BLACK)
            axis.axhline(estimate, color=colour, ls="--", label=name)
            axis.axhspan(low, high, color=colour, alpha=0.15, lw=0)
        axis.set_xlabel("training episodes")
        axis.set_title(label, fontsize=9)
        axis.grid(lw=0.4)
        axis.set_xlim(left=0)
    axes[0].set_ylim(bottom=0)
    axes[0].legend(frameon=False)


def _known(values: Sequence[float | None]) -> list[float]:
    return [nan if x is None else x for x in values]


def coverage_figure(numbers: Mapping[str, Any]) -> Figure:
    """Joint states met in the course of the training, and how many the leaves could make."""
    figure = Figure((5.0, 3.2), layout="constrained")
    axis = figure.subplots()
    for place, (name, found) in enumerate(numbers.items()):
        estimate, low, high = (_known(line) for line in found["joint_states"])
        colour = COLOURS.get(name, SERIES[place])
        axis.plot(found["episodes"], estimate, color=colour, label=name)
        axis.fill_between(found["episodes"], low, high, color=colour, alpha=0.2, lw=0)
    least, most = zip(*(found["leaf_product"] for found in numbers.values()), strict=True)
    axis.axhspan(min(least), max(most), color=GREY, alpha=0.3, lw=0, label="product of the leaves")
    axis.set_xlim(left=0)
    axis.set_ylim(bottom=0)
    axis.set_xlabel("training episodes")
    axis.set_title("joint states met, of as many as the leaves could make", fontsize=9)
    axis.grid(lw=0.4)
    axis.legend(frameon=False, loc="center right")
    return figure


def intervals_figure(rows: Sequence[Mapping[str, Any]], name: str, label: str) -> Figure:
    """A ratio and its interval for each method, on a logarithmic axis; 1 is the control."""
    figure = Figure((7.0, 0.27 * len(rows) + 0.9), layout="constrained")
    axis = figure.subplots()
    _intervals(axis, [(row[name], row[f"{name}_low"], row[f"{name}_high"]) for row in rows])
    _on_a_logarithmic_axis(axis)
    axis.axvline(1.0, color=GREY, lw=0.8)
    axis.set_yticks(range(len(rows)), [row["method"] for row in rows])
    axis.set_ylim(len(rows) - 0.4, -0.6)
    axis.set_xlabel(label)
    return figure


def _intervals(axis: Axes, found: Sequence[Sequence[float | None]]) -> None:
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


def _on_a_logarithmic_axis(axis: Axes) -> None:
    axis.set_xscale("log")
    low, high = axis.get_xlim()
    axis.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if high < 500.0 * low else (1.0,)))
    axis.xaxis.set_major_formatter(FormatStrFormatter("%g"))
    axis.xaxis.set_minor_formatter(NullFormatter())


def maps_figure(numbers: Mapping[str, Any]) -> Figure:
    """Which behavior has the largest weight where the robot stands, and how large it is, for some headings; of each learner."""
    figure = Figure((9.5, 0.8 + 2.6 * len(numbers)), layout="constrained")
    columns = len(next(iter(numbers.values()))["headings_rad"])
    axes = figure.subplots(len(numbers), columns, sharex=True, sharey=True, squeeze=False)
    names: list[str] = []
    for row, (learner, found) in zip(axes, numbers.items(), strict=True):
        names = found["behaviors"]
        _maps(row, found)
        row[0].set_ylabel(f"{learner}\nrobot y [m]")
    for axis in axes[-1]:
        axis.set_xlabel("robot x [m]")
    handles = [
        Patch(color=colour, label=name.replace("_", " ")) for name, colour in zip(names, BEHAVIORS, strict=False)
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=len(names), frameon=False)
    return figure


def _maps(axes: Sequence[Axes], found: Mapping[str, Any]) -> None:
    x, y = found["x_m"], found["y_m"]
    half = (x[1] - x[0]) / 2
    for axis, heading, weights in zip(axes, found["headings_rad"], np.array(found["weights"]) / 100.0, strict=True):
        axis.imshow(
            _blended(weights), origin="lower", extent=(x[0] - half, x[-1] + half, y[0] - half, y[-1] + half),
            interpolation="nearest",
        )  # fmt: skip
        axis.plot(*found["ball_m"], "o", color="white", mec=BLACK, ms=6)
        length = 0.16
        axis.annotate(
            "", (-0.9 + length * cos(heading), length * sin(heading)), (-0.9, 0.0),
            arrowprops={"arrowstyle": "->", "color": BLACK},
        )  # fmt: skip
        axis.set_title(f"robot heads {degrees(heading):.0f} deg", fontsize=9)


def _blended(weights: NDArray[np.float64]) -> NDArray[np.float64]:
    """The colour of the heaviest behavior, the paler the nearer its weight is to 1/n, [rows, columns, rgb].

    Args:
        weights: [rows, columns, n].
    """
    n = weights.shape[2]
    colours = np.array([to_rgb(colour) for colour in BEHAVIORS[:n]])
    strength = np.clip((weights.max(axis=2) - 1.0 / n) / (1.0 - 1.0 / n), 0.0, 1.0)[:, :, None]
    return 1.0 - strength * (1.0 - colours[weights.argmax(axis=2)])


def scaling_figure(numbers: Mapping[str, Any]) -> Figure:
    """Memory and learning with more and more behaviors."""
    figure = Figure((9.5, 3.2), layout="constrained")
    axes = figure.subplots(1, 3)
    memory = numbers["memory"]
    counts = [row["behaviors"] for row in memory]
    told = {
        "leaf_product": ("product of the leaves", VERMILLION, "s--"),
        "features": ("features of fbql", BLUE, "o-"),
        "joint_states": ("joint states met", GREEN, "^-"),
    }
    for name, (label, colour, marks) in told.items():
        axes[0].plot(counts, [row[name] for row in memory], marks, color=colour, label=label, ms=4)
    axes[0].set_yscale("log")
    axes[0].set_xticks(counts)
    axes[0].set_xlabel("behaviors")
    axes[0].set_title("what could be and what was met", fontsize=9)
    axes[0].grid(lw=0.4)
    axes[0].legend(frameon=False)
    _learning(axes[1:], numbers["learning"])
    return figure


def peers_figure(rows: Sequence[Mapping[str, Any]]) -> Figure:
    """Cost of a goal and success rate of every method, with intervals."""
    figure = Figure((9.5, 0.27 * len(rows) + 0.9), layout="constrained")
    axes = figure.subplots(1, 2, sharey=True)
    labels = {"cost": "steps of all episodes / goals", "success": "success rate"}
    for axis, (name, label) in zip(axes, labels.items(), strict=True):
        _intervals(axis, [row[name] for row in rows])
        axis.set_xlabel(label)
    _on_a_logarithmic_axis(axes[0])
    axes[0].set_yticks(range(len(rows)), [row["method"] for row in rows])
    axes[0].set_ylim(len(rows) - 0.4, -0.6)
    return figure


def peers_training_figure(numbers: Mapping[str, Any]) -> Figure:
    """Success rate over the course of the trainings, exploration included."""
    figure = Figure((9.5, 3.4), layout="constrained")
    axis = figure.subplots()
    others = [colour for colour in SERIES if colour not in {COLOURS.get(method) for method in numbers}]
    for place, (method, lines) in enumerate(numbers.items()):
        estimate, low, high = (_known(line) for line in lines)
        at = [(i + 0.5) / len(estimate) for i in range(len(estimate))]
        colour = COLOURS.get(method, others[place % len(others)])
        axis.plot(at, estimate, color=colour, label=method)
        axis.fill_between(at, low, high, color=colour, alpha=0.2, lw=0)
    axis.set_xlabel("share of the budget")
    axis.set_title("success rate in training", fontsize=9)
    axis.set_xlim(0, 1)
    axis.set_ylim(-0.02, 1.02)  # lines at the edges are to be seen
    axis.grid(lw=0.4)
    axis.legend(frameon=False, loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure


FIGURES: dict[str, Callable[[Any], Figure]] = {
    "paper": paper_figure,
    "learning": learning_figure,
    "coverage": coverage_figure,
    "ladder": partial(intervals_figure, name="ratio_retuned", label="cost/goal to re-tuned Subsumption's"),
    "ablation": partial(intervals_figure, name="ratio_default", label="cost/goal to the default's"),
    "sensitivity": partial(intervals_figure, name="ratio_default", label="cost/goal to the default's"),
    "maps": maps_figure,
    "scaling": scaling_figure,
    "peers": peers_figure,
    "peers_training": peers_training_figure,
}
"""Name -> what draws it."""
