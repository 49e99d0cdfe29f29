"""The figures of the studies of fusion, drawn from small files of numbers, in the colours of Okabe and Ito."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping
from io import StringIO
from pathlib import Path
from typing import Any

from fbql_fusion.atomic_file import write_atomically
from matplotlib import rc_context
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure

from studies.courses import MEASURES

Curves = Mapping[str, Any]
"""Name of a figure -> what it is drawn from, as plain JSON values."""
CURVES = "curves.json"
BLACK, ORANGE, SKY, GREEN = "#000000", "#E69F00", "#56B4E9", "#009E73"
BLUE, VERMILLION, PURPLE, GREY = "#0072B2", "#D55E00", "#CC79A7", "#888888"
COLOURS = {
    "fbql": BLUE,
    "subsumption, paper": VERMILLION,
    "subsumption, re-tuned": GREEN,
    "fbql literal, ties: none": PURPLE,
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
            at = range(1, len(mean) + 1)
            colour = COLOURS.get(method, BLACK)
            axis.plot(at, mean, color=colour, label=method)
            axis.fill_between(at, low, high, color=colour, alpha=0.2, lw=0)
        axis.set_title(TITLES[measure], fontsize=9)
        axis.set_ylim(bottom=0)
        axis.grid(lw=0.4)
    for axis in axes[1]:
        axis.set_xlabel("success")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=4, frameon=False)
    return figure


FIGURES: dict[str, Callable[[Any], Figure]] = {"paper": paper_figure}
"""Name -> what draws it."""
