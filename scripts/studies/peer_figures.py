"""The figures of the study of peers."""

from __future__ import annotations

from collections.abc import Mapping
from io import StringIO
from pathlib import Path
from typing import Any

from matplotlib import rc_context
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from peers.course import SLICES

from studies.inference import ratio_of_sums

Runs = Mapping[str, Mapping[tuple[int, int], Mapping[str, Any]]]
STYLE = {
    "font.size": 9,
    "font.sans-serif": ["DejaVu Sans", "Verdana", "Arial"],
    "axes.spines.top": False,
    "axes.spines.right": False,
    "svg.fonttype": "none",
    "svg.hashsalt": "peers",
}
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
MOST_COST = 6000
"""Methods that cost more have hardly a goal: their intervals would hide the others."""


def draw(runs: Runs, directory: Path) -> list[Path]:
    """Draws what the runs have something for; gives the files."""
    drawings = {"frozen": frozen_figure(runs)}
    learners = {method: by_run for method, by_run in runs.items() if any("curve" in each for each in by_run.values())}
    if learners:
        drawings["curves"] = curves_figure(learners)
    files: list[Path] = []
    with rc_context(STYLE):
        for name, figure in drawings.items():
            text = StringIO()
            FigureCanvasSVG(figure).print_svg(text, metadata={"Date": None, "Creator": None})
            files.append(directory / f"peers_{name}.svg")
            files[-1].write_text(text.getvalue())
    return files


def frozen_figure(runs: Runs) -> Figure:
    """Cost of a goal and success rate of every method, with confidence intervals over runs."""
    figure = Figure((9.5, 0.3 * len(runs) + 1.2), layout="constrained")
    axes = figure.subplots(1, 2, sharey=True)
    kinds = (("steps of all episodes / goals", "steps", "goals"), ("success rate", "goals", "episodes"))
    for axis, (label, numerator, denominator) in zip(axes, kinds, strict=True):
        for place, by_run in enumerate(runs.values()):
            found = ratio_of_sums(
                [each[numerator] for each in by_run.values()], [each[denominator] for each in by_run.values()]
            )
            axis.plot([found.low, found.high], [place, place], color=COLOURS[0], lw=2)
            axis.plot(found.estimate, place, "o", color=COLOURS[0], ms=4)
        axis.set_yticks(range(len(runs)), list(runs))
        axis.grid(axis="x", lw=0.4)
        axis.set_xlabel(label)
    axes[0].set_xlim(0, MOST_COST)
    axes[0].invert_yaxis()
    return figure


def curves_figure(learners: Runs) -> Figure:
    """Success rate over the course of the training, exploration included, with confidence intervals over runs."""
    figure = Figure((9.5, 3.4), layout="constrained")
    axis = figure.subplots()
    for place, (method, by_run) in enumerate(learners.items()):
        at, low, middle, high = [], [], [], []
        for number in range(SLICES):
            rows = [each["curve"][number] for each in by_run.values()]
            if any(row["episodes"] for row in rows):
                found = ratio_of_sums([row["goals"] for row in rows], [row["episodes"] for row in rows])
                at.append((number + 0.5) / SLICES)
                low.append(found.low)
                middle.append(found.estimate)
                high.append(found.high)
        colour = COLOURS[place % len(COLOURS)]
        axis.plot(at, middle, color=colour, label=method)
        axis.fill_between(at, low, high, color=colour, alpha=0.2, lw=0)
    axis.set_xlabel("share of the budget")
    axis.set_ylabel("success rate in training")
    axis.set_xlim(0, 1)
    axis.set_ylim(-0.02, 1.02)  # lines at the edges are to be seen
    axis.grid(lw=0.4)
    axis.legend(frameon=False, loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure
