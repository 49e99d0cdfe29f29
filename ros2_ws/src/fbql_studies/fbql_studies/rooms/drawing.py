"""Pictures of rooms, with the robot's trail colored by who drove. Needs Matplotlib."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from math import ceil, sqrt
from pathlib import Path
from typing import NamedTuple

from fbql_studies.rooms.maps import SIZE_M, Room
from fbql_studies.rooms.robot import GOAL_RADIUS_M, RADIUS_M
from fbql_studies.rooms.sources import SOURCES

COLOURS = dict(zip(SOURCES, ("#1b7837", "#2166ac", "#e08214", "#c51b7d", "#b2182b"), strict=True))
OTHER = "#6a3d9a"


class Trail(NamedTuple):
    """A drive through a room."""

    room: Room
    points: Sequence[tuple[float, float, str]]
    """x, y [m], and the source that drove on from there; empty: none."""


def draw(trails: Sequence[Trail], path: Path) -> None:
    """Draws rooms side by side into a PNG or SVG file."""
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
    from matplotlib.patches import Circle, Polygon

    columns = ceil(sqrt(len(trails)))
    rows = ceil(len(trails) / columns)
    figure = Figure(figsize=(3.0 * columns, 3.0 * rows + 0.4), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False)
    for place in axes.flat:
        place.set_axis_off()
    for place, (room, points) in zip(axes.flat, trails, strict=False):
        for polygon in room.obstacles:
            place.add_patch(Polygon(polygon, facecolor="#999999", edgecolor="none"))
        place.add_patch(Circle(room.goal, GOAL_RADIUS_M, facecolor="none", edgecolor=COLOURS["goal"], linewidth=1.5))
        place.add_patch(Circle(room.start[:2], RADIUS_M, facecolor="none", edgecolor="black"))
        for (x, y, driver), (next_x, next_y, _) in itertools.pairwise(points):
            place.plot(
                [x, next_x], [y, next_y], color=COLOURS.get(driver, OTHER), linewidth=1.5, solid_capstyle="round"
            )
        if points:
            place.plot(*points[-1][:2], "o", color="black", markersize=3)
        place.set_xlim(-0.3, SIZE_M + 0.3)
        place.set_ylim(-0.3, SIZE_M + 0.3)
        place.set_aspect("equal")
        place.set_title(f"{room.family} {room.seed}", fontsize=8)
    others = sorted({driver for trail in trails for *_, driver in trail.points} - COLOURS.keys() - {""})
    handles = [Line2D([], [], color=COLOURS.get(name, OTHER), label=name) for name in (*COLOURS, *others)]
    ncols = min(len(handles), 3 * columns)
    figure.legend(handles=handles, loc="outside lower center", ncols=ncols, fontsize=8, frameon=False)
    figure.savefig(path, dpi=150)
