"""The analogues of the paper's Figs. 10 to 14."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from fbql.statistics.courses import MEASURES
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from fbql_studies.common.drawing import BLACK, COLOURS

TITLES = {
    "failures": "failures before a success",
    "steps": "steps of a success (Figs. 10, 12)",
    "all steps": "steps, failures before it included",
    "collisions begun": "collisions begun (Figs. 11, 13)",
    "contact steps": "steps in contact (Figs. 11, 13)",
    "success rate": "success rate (Fig. 14)",
}


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


FIGURES = {"paper": paper_figure}
