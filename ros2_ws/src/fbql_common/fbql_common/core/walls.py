"""The walls' inner faces, and the wall point closest to a place: the map of the field that the simulator and a world model share.

The inside is an octagon (the field without its corner triangles) with two goal pockets. The goal mouths are open: they
are not wall, the pockets' sides and backs are. Frame "field", lengths in meters.
"""

from __future__ import annotations

from math import atan2, sqrt

from fbql_common.core.field import FIELD
from fbql_common.core.kernels import kernel

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
_DIAGONAL = -sqrt(0.5)


@kernel
def closest_wall(x_m: float, y_m: float) -> tuple[float, float, float, float, bool]:
    """The wall point closest to a point inside, and the wall's normal there.

    The arena is symmetric in both axes, so the quarter of the point holds a closest wall point. Where two walls
    are equally near (the axes of symmetry, the bisectors of the corners) one of them is taken, always the same.

    Args:
        x_m, y_m: a point of the field or of a goal pocket [m].

    Returns:
        x, y of the wall point [m], the unit vector from it into the field (normal to the wall, and at a goal post, a
        convex corner, towards the given point), and whether it is a goal post.
    """
    post = False
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
                    x, y, nx, ny, post = HALF_LENGTH, HALF_GOAL, -dx / length, -dy / length, True
                # the back of the pocket, seen through the mouth
                dx = POCKET - px
                distance = dx * dx
                if distance < best:
                    best = distance
                    x, y, nx, ny, post = POCKET, py, -1.0, 0.0, False
        # the corner triangle: t runs along its 45 degree face
        t = 0.5 * (px - SIDE_END + HALF_WIDTH - py)
        if 0.0 < t < CORNER:
            cx, cy = SIDE_END + t, HALF_WIDTH - t
            dx, dy = cx - px, cy - py
            if dx * dx + dy * dy < best:
                x, y, nx, ny, post = cx, cy, _DIAGONAL, _DIAGONAL, False
    if x_m < 0.0:
        x, nx = -x, 0.0 - nx
    if y_m < 0.0:
        y, ny = -y, 0.0 - ny  # never -0.0, whose direction would be -pi
    return x, y, nx, ny, post


def closest_wall_point(x_m: float, y_m: float) -> tuple[float, float, float]:
    """x, y of the wall point closest to a point inside [m], and the direction from it into the field [rad].

    See `closest_wall`.
    """
    x, y, normal_x, normal_y, _ = _closest_wall(x_m, y_m)
    return x, y, atan2(normal_y, normal_x)


_closest_wall = closest_wall.function
"""The plain function: the simulator never runs compiled."""
