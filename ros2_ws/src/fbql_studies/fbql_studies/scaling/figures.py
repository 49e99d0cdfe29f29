"""The figure of the study of scaling."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from matplotlib.figure import Figure

from fbql_studies.common.drawing import BLUE, GREEN, VERMILLION, draw_learning


def scaling_figure(numbers: Mapping[str, Any]) -> Figure:
    """Memory and learning with an increasing number of behaviors."""
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
    draw_learning(axes[1:], numbers["learning"])
    return figure


FIGURES = {"scaling": scaling_figure}
