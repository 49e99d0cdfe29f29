"""Eq. 27: the known sizes keep robot, ball and walls from overlapping. Pure functions of places [m] and headings [rad].

The robot is a square, the ball a circle. What overlaps is moved apart along the shortest way; velocities stay.
"""

from __future__ import annotations

from math import sqrt

from fbql_common.core.field import BALL_RADIUS_M, ROBOT_SIDE_M
from fbql_common.core.kernels import kernel
from fbql_common.core.walls import CORNER, HALF_LENGTH, HALF_WIDTH, closest_wall

_HALF = ROBOT_SIDE_M / 2
_RADIUS = BALL_RADIUS_M
ROBOT_REACH_M = _HALF * sqrt(2.0)
"""Nothing farther from the robot's center touches it."""
TOUCH_M = ROBOT_REACH_M + _RADIUS
"""The ball and the robot do not touch if their centers are farther from each other."""
_ROOT_HALF = sqrt(0.5)
_CORNERS = 2
"""How often a body is moved off the closest wall: the number of walls that can meet."""


@kernel
def room(x_m: float, y_m: float) -> float:
    """No wall is nearer to a place than this [m]: cheaper than the distance of the closest one. Below 0 in a goal pocket."""
    to_end, to_side = HALF_LENGTH - abs(x_m), HALF_WIDTH - abs(y_m)
    return min(to_end, to_side, (to_end + to_side - CORNER) * _ROOT_HALF)


@kernel
def ball_off_walls(x_m: float, y_m: float) -> tuple[float, float]:
    """The ball's center, moved until the ball no longer overlaps a wall."""
    if room(x_m, y_m) >= _RADIUS:
        return x_m, y_m
    for _ in range(_CORNERS):
        wall_x, wall_y, normal_x, normal_y, _ = closest_wall(x_m, y_m)
        lack = _RADIUS - ((x_m - wall_x) * normal_x + (y_m - wall_y) * normal_y)
        if lack <= 0.0:
            break
        x_m += lack * normal_x
        y_m += lack * normal_y
    return x_m, y_m


@kernel
def robot_off_walls(x_m: float, y_m: float, cosine: float, sine: float) -> tuple[float, float]:
    """The robot's center, moved until the robot no longer overlaps a wall.

    Args:
        cosine, sine: of its heading.
    """
    for _ in range(_CORNERS):
        wall_x, wall_y, normal_x, normal_y, post = closest_wall(x_m, y_m)
        along = abs(cosine * normal_x + sine * normal_y)
        across = abs(cosine * normal_y - sine * normal_x)
        reach = _HALF / max(along, across) if post else _HALF * (along + across)
        lack = reach - ((x_m - wall_x) * normal_x + (y_m - wall_y) * normal_y)
        if lack <= 0.0:
            break
        x_m += lack * normal_x
        y_m += lack * normal_y
    return x_m, y_m


@kernel
def ball_off_robot(x_m: float, y_m: float) -> tuple[float, float]:
    """The ball's center in the robot's frame, moved until the ball no longer overlaps the robot."""
    near_x = min(max(x_m, -_HALF), _HALF)
    near_y = min(max(y_m, -_HALF), _HALF)
    dx, dy = x_m - near_x, y_m - near_y
    squared = dx * dx + dy * dy
    if squared >= _RADIUS * _RADIUS:
        return x_m, y_m
    if squared > 0.0:
        scale = _RADIUS / sqrt(squared)
        return near_x + dx * scale, near_y + dy * scale
    # the center is in the square: out at the nearest side
    if abs(x_m) >= abs(y_m):
        return (_HALF + _RADIUS if x_m >= 0.0 else -_HALF - _RADIUS), y_m
    return x_m, (_HALF + _RADIUS if y_m >= 0.0 else -_HALF - _RADIUS)
