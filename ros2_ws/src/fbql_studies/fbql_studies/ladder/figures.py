"""The figures of the ladder: learning curves, joint states met, costs, and maps of the weights."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from math import cos, degrees, sin
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import NDArray

from fbql_studies.common.drawing import (
    BLACK,
    BLUE,
    COLOURS,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    SERIES,
    SKY,
    VERMILLION,
    draw_learning,
    intervals_figure,
    known,
)

BEHAVIORS = (ORANGE, SKY, PURPLE, GREEN, VERMILLION, BLUE, BLACK, GREY)
"""One per behavior; the first three as in the picture of an episode (ros2_ws/src/fbql/fbql/pictures/episode.py)."""


def learning_figure(numbers: Mapping[str, Any]) -> Figure:
    """Success rate and cost of a goal over the course of the training, exploration included."""
    figure = Figure((9.5, 3.4), layout="constrained")
    axes = figure.subplots(1, 2)
    draw_learning(axes, numbers)
    return figure


def coverage_figure(numbers: Mapping[str, Any]) -> Figure:
    """Joint states met in the course of the training, and the number that the leaves could form."""
    figure = Figure((5.0, 3.2), layout="constrained")
    axis = figure.subplots()
    for place, (name, found) in enumerate(numbers.items()):
        estimate, low, high = (known(line) for line in found["joint_states"])
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
    """The color of the heaviest behavior, the paler the nearer its weight is to 1/n, [rows, columns, rgb].

    Args:
        weights: [rows, columns, n].
    """
    n = weights.shape[2]
    colours = np.array([to_rgb(colour) for colour in BEHAVIORS[:n]])
    strength = np.clip((weights.max(axis=2) - 1.0 / n) / (1.0 - 1.0 / n), 0.0, 1.0)[:, :, None]
    return 1.0 - strength * (1.0 - colours[weights.argmax(axis=2)])


FIGURES = {
    "learning": learning_figure,
    "coverage": coverage_figure,
    "ladder": partial(intervals_figure, name="ratio_retuned", label="cost/goal to re-tuned Subsumption's"),
    "maps": maps_figure,
}
