"""The walls around the field as solid blocks for the physics.

The inside is an octagon (the field without its corner triangles) with two goal pockets. The goal mouths are open:
they are not wall, the pockets' sides and backs are. Frame "field", lengths in meters.
"""

from __future__ import annotations

from fbql_common.core.walls import END_END, HALF_GOAL, HALF_LENGTH, HALF_WIDTH, POCKET, SIDE_END

Point = tuple[float, float]

THICKNESS = 0.5
"""Walls are blocks of this depth, so that nothing passes through one in a physics step."""


def _quarter_segments() -> tuple[tuple[Point, Point], ...]:
    return (
        ((0.0, HALF_WIDTH), (SIDE_END, HALF_WIDTH)),
        ((SIDE_END, HALF_WIDTH), (HALF_LENGTH, END_END)),
        ((HALF_LENGTH, END_END), (HALF_LENGTH, HALF_GOAL)),
        ((HALF_LENGTH, HALF_GOAL), (POCKET, HALF_GOAL)),
        ((POCKET, HALF_GOAL), (POCKET, 0.0)),
    )


SIGNS = ((1, 1), (1, -1), (-1, 1), (-1, -1))

SEGMENTS: tuple[tuple[Point, Point], ...] = tuple(
    ((sx * x0, sy * y0), (sx * x1, sy * y1)) for sx, sy in SIGNS for (x0, y0), (x1, y1) in _quarter_segments()
)
"""The wall segments, each as its two ends [m]."""


def wall_blocks() -> list[list[Point]]:
    """The walls as convex polygons [m], whose inner faces are SEGMENTS."""
    far_x, far_y = POCKET + THICKNESS, HALF_WIDTH + THICKNESS
    blocks: list[list[Point]] = []
    for side in (1, -1):
        blocks.append(
            [(-far_x, side * HALF_WIDTH), (far_x, side * HALF_WIDTH), (far_x, side * far_y), (-far_x, side * far_y)]
        )
        blocks.append(
            [
                (side * POCKET, -HALF_GOAL),
                (side * POCKET, HALF_GOAL),
                (side * far_x, HALF_GOAL),
                (side * far_x, -HALF_GOAL),
            ]
        )
    for sx, sy in SIGNS:
        end = [(HALF_LENGTH, HALF_GOAL), (far_x, HALF_GOAL), (far_x, HALF_WIDTH), (HALF_LENGTH, HALF_WIDTH)]
        corner = [(SIDE_END, HALF_WIDTH), (HALF_LENGTH, END_END), (HALF_LENGTH, HALF_WIDTH)]
        blocks.extend([(sx * x, sy * y) for x, y in block] for block in (end, corner))
    return blocks
