"""The figures of the peers: what each costs, and the course of the trainings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from matplotlib.figure import Figure

from fbql_studies.common.drawing import COLOURS, SERIES, draw_intervals, known, use_logarithmic_axis


def peers_figure(rows: Sequence[Mapping[str, Any]]) -> Figure:
    """Cost of a goal and success rate of every method, with intervals."""
    figure = Figure((9.5, 0.27 * len(rows) + 0.9), layout="constrained")
    axes = figure.subplots(1, 2, sharey=True)
    labels = {"cost": "steps of all episodes / goals", "success": "success rate"}
    for axis, (name, label) in zip(axes, labels.items(), strict=True):
        draw_intervals(axis, [row[name] for row in rows])
        axis.set_xlabel(label)
    use_logarithmic_axis(axes[0])
    axes[0].set_yticks(range(len(rows)), [row["method"] for row in rows])
    axes[0].set_ylim(len(rows) - 0.4, -0.6)
    return figure


def peers_training_figure(numbers: Mapping[str, Any]) -> Figure:
    """Success rate over the course of the trainings, exploration included."""
    figure = Figure((9.5, 3.4), layout="constrained")
    axis = figure.subplots()
    others = [colour for colour in SERIES if colour not in {COLOURS.get(method) for method in numbers}]
    for place, (method, lines) in enumerate(numbers.items()):
        estimate, low, high = (known(line) for line in lines)
        at = [(i + 0.5) / len(estimate) for i in range(len(estimate))]
        colour = COLOURS.get(method, others[place % len(others)])
        axis.plot(at, estimate, color=colour, label=method)
        axis.fill_between(at, low, high, color=colour, alpha=0.2, lw=0)
    axis.set_xlabel("share of the budget")
    axis.set_title("success rate in training", fontsize=9)
    axis.set_xlim(0, 1)
    axis.set_ylim(-0.02, 1.02)  # keep lines at the edges visible
    axis.grid(lw=0.4)
    axis.legend(frameon=False, loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure


FIGURES = {"peers": peers_figure, "peers_training": peers_training_figure}
