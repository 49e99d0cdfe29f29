"""The walls around the field: solid blocks for the physics, and the wall point closest to the robot.

The inside is an octagon (the field without its corner triangles) with two goal pockets. The goal mouths are open:
they are not wall, the pockets' sides and backs are. Frame "field", lengths in metres.
"""

from __future__ import annotations

from math import atan2, sqrt

from fbql_common.core.field import FIELD

Point = tuple[float, float]

HALF_LENGTH = FIELD.half_length_m
HALF_WIDTH = FIELD.half_width_m
HALF_GOAL = FIELD.half_goal_m
POCKET = HALF_LENGTH + FIELD.goal_depth_m
"""|x| of the back of a goal pocket."""
CORNER = FIELD.corner_m
SIDE_END = HALF_LENGTH - CORNER
"""|x| where a side wall meets the corner triangle."""
END_END = HALF_WIDTH - CORNER
"""|y| where an end wall meets the corner triangle."""
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


def closest_wall_point(x_m: float, y_m: float) -> tuple[float, float, float]:
    """The wall point closest to a point inside, and the wall's normal there.

    The arena is symmetric in both axes, so the quarter of the point holds a closest wall point. Where two walls
    are equally near (the axes of symmetry, the bisectors of the corners) one of them is taken, always the same.

    Args:
        x_m, y_m: a point of the field or of a goal pocket [m].

    Returns:
        x, y of the wall point [m], and the direction from it into the field [rad]: normal to the wall, and at a
        goal post (a convex corner) towards the given point.
    """
    px = x_m if x_m >= 0.0 else -x_m
    py = y_m if y_m >= 0.0 else -y_m
    if px > HALF_LENGTH and py < HALF_GOAL:
        # in the pocket: its back, or its side
        to_back = POCKET - px
        to_side = HALF_GOAL - py
        if to_back <= to_side:
            x, y, nx, ny = POCKET, py, -1.0, 0.0
        else:
            x, y, nx, ny = px if px < POCKET else POCKET, HALF_GOAL, 0.0, -1.0
    else:
        # the side wall; beyond its end the corner triangle is closer
        x, y, nx, ny = px if px < SIDE_END else SIDE_END, HALF_WIDTH, 0.0, -1.0
        dx, dy = x - px, y - py
        best = dx * dx + dy * dy
        # nothing at the end of the field is closer than the line of the end wall
        dx = HALF_LENGTH - px
        if dx * dx < best:
            if py >= HALF_GOAL:
                # the end wall between the corner triangle and the post
                ey = py if py < END_END else END_END
                dy = ey - py
                distance = dx * dx + dy * dy
                if distance < best:
                    best = distance
                    x, y, nx, ny = HALF_LENGTH, ey, -1.0, 0.0
            else:
                dy = HALF_GOAL - py
                distance = dx * dx + dy * dy
                if distance < best:
                    best = distance
                    length = sqrt(distance) or 1.0
                    x, y, nx, ny = HALF_LENGTH, HALF_GOAL, -dx / length, -dy / length
                # the back of the pocket, seen through the mouth
                dx = POCKET - px
                distance = dx * dx
                if distance < best:
                    best = distance
                    x, y, nx, ny = POCKET, py, -1.0, 0.0
        # the corner triangle: t runs along its 45 degree face
        t = 0.5 * (px - SIDE_END + HALF_WIDTH - py)
        if 0.0 < t < CORNER:
            cx, cy = SIDE_END + t, HALF_WIDTH - t
            dx, dy = cx - px, cy - py
            if dx * dx + dy * dy < best:
                x, y, nx, ny = cx, cy, -1.0, -1.0
    if x_m < 0.0:
        x, nx = -x, 0.0 - nx
    if y_m < 0.0:
        y, ny = -y, 0.0 - ny  # never -0.0, whose direction would be -pi
    return x, y, atan2(ny, nx)
