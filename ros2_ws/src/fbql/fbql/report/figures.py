"""Figures of a run like the paper's Figs. 10 to 14, as PDF and SVG, with their numbers as CSV.

Each success (goal) of the run is a point: the effort since the previous one. Lines are moving averages over
`fbql.statistics.courses.WINDOW` successes, beginning with the first full window. Guided episodes are left out.
"""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from fbql_common.files import atomic_text, write_atomically
from fbql_recording.core.episodes import Episode
from fbql_recording.core.metrics import OUTCOMES
from matplotlib import rc_context
from matplotlib.figure import Figure
from numpy.typing import NDArray

from fbql.pictures.style import BLUE, ORANGE, STYLE, pdf_bytes, svg_bytes, text
from fbql.report.contents import counted
from fbql.statistics.courses import MEASURES, WINDOW, moving_average, successes_of

FIGURES = {
    "success_steps": ("steps of a success", ("all steps", "steps")),
    "success_collisions": ("collisions of a success", ("collisions begun",)),
    "success_failures": ("failures before a success", ("failures",)),
    "success_rate": ("success rate", ("success rate",)),
}
"""Name of a figure -> the label of its axis, and the measures that it shows."""
NUMBERS = "successes.csv"
_LABELS = {"all steps": "with the failures before it", "steps": "of the episode that ended with it"}
_LINES = ((BLUE, "-"), (ORANGE, "--"))


def course_of(episodes: Sequence[Episode]) -> list[tuple[int, int, int, int]]:
    """Outcome, steps, collisions begun and steps in contact of each episode that is not guided and was recorded to its
    end."""
    return [
        (OUTCOMES.index(each.outcome), each.steps, each.collisions_begun or 0, each.collision_steps or 0)
        for each in counted(episodes)
        if each.outcome is not None
    ]


def write_figures(episodes: Sequence[Episode], title: str, directory: Path) -> list[Path]:
    """Writes every figure and the numbers that they show. Returns the files. Raises OSError."""
    table = successes_of(course_of(episodes))
    files = [_write_numbers(table, directory / NUMBERS)]
    with rc_context(STYLE):
        for name, (label, measures) in FIGURES.items():
            figure = _figure(table, title, label, measures)
            for ending, content in (("pdf", pdf_bytes(figure)), ("svg", svg_bytes(figure))):
                files.append(directory / f"{name}.{ending}")
                write_atomically(files[-1], content)
    return files


def _figure(table: NDArray[Any], title: str, label: str, measures: Sequence[str]) -> Figure:
    figure = Figure((4.6, 3.0), layout="constrained")
    axes = figure.subplots()
    means = moving_average(table)
    at = range(1, len(table) + 1)
    at_means = range(WINDOW, WINDOW + len(means))
    for measure, (colour, dashes) in zip(measures, _LINES, strict=False):
        column = MEASURES.index(measure)
        each, mean = table[:, column], means[:, column]
        if measure == "success rate":  # the table holds episodes per success
            mean = 1.0 / mean
        else:
            axes.plot(at, each, "o" if dashes == "-" else "x", color=colour, ms=2.5, alpha=0.6)
        axes.plot(at_means, mean, dashes, color=colour, label=_LABELS.get(measure))
    if not len(table):
        axes.text(0.5, 0.5, "n/a: no goal", transform=axes.transAxes, ha="center")
    axes.set_title(text(title), fontsize=8)
    axes.set_xlabel(f"success (line: moving average over {WINDOW})")
    axes.set_ylabel(label)
    axes.set_ylim(bottom=0, top=1.05 if measures == ("success rate",) else None)
    axes.grid(lw=0.4)
    if len(measures) > 1:
        figure.legend(loc="outside lower center", ncols=2, frameon=False)
    return figure


def _write_numbers(table: NDArray[Any], path: Path) -> Path:
    """What the figures show: the measures of each success, and their moving averages, empty until there is a full window."""
    names = [measure.replace(" ", "_") for measure in MEASURES[:-1]]
    head = ["success", *names, "episodes", *(f"mean_{name}" for name in names), "mean_success_rate"]
    with atomic_text(path) as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(head)
        none = [[""] * len(MEASURES)] * min(WINDOW - 1, len(table))
        means = none + [[*mean[:-1], 1.0 / mean[-1]] for mean in moving_average(table).tolist()]
        for number, (row, mean) in enumerate(zip(table.tolist(), means, strict=True), start=1):
            writer.writerow([number, *(int(each) for each in row), *mean])
    return path
