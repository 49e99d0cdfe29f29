"""A twin of IR-SIM's scan and collision test for rooms of convex polygons: the same numbers, many times faster.

tests/fbql_studies/rooms/test_worlds.py checks that the two agree. It is fast because it skips edges out of range and those that
face away from the robot, which stands outside every polygon, and because its loops are compiled where possible.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, pi, sin, sqrt

import numpy as np
from fbql_common.core.kernels import kernel, kernel_for
from numpy.typing import NDArray

from fbql_studies.rooms.maps import Polygon
from fbql_studies.rooms.robot import ANGLES, BEAMS, RADIUS_M, RANGE_M, Ranges

Floats = NDArray[np.float64]
_CORNERS = 64
"""IR-SIM's robot is a polygon with this many corners, one of them straight ahead, on the circle of its radius."""
_COS, _SIN = np.cos(ANGLES), np.sin(ANGLES)


def edges_of(obstacles: Sequence[Polygon]) -> Floats:
    """The edges of polygons: x and y of where each begins, and its extent along x and y, [edges, 4]."""
    begin = np.array([corner for polygon in obstacles for corner in polygon])
    end = np.array([corner for polygon in obstacles for corner in (*polygon[1:], polygon[0])])
    return np.hstack([begin, end - begin])


def _distances_at_once(edges: Floats, x: float, y: float) -> Floats:
    ox, oy, dx, dy = x - edges[:, 0], y - edges[:, 1], edges[:, 2], edges[:, 3]
    share = np.minimum(np.maximum((ox * dx + oy * dy) / (dx * dx + dy * dy), 0.0), 1.0)
    ox, oy = ox - share * dx, oy - share * dy
    return np.sqrt(ox * ox + oy * oy)


@kernel_for(_distances_at_once)
def distances(edges: Floats, x: float, y: float) -> Floats:
    """The distance of a point from each edge, [edges]."""
    found = np.empty(len(edges))
    for i in range(len(edges)):
        ox, oy, dx, dy = x - edges[i, 0], y - edges[i, 1], edges[i, 2], edges[i, 3]
        share = min(max((ox * dx + oy * dy) / (dx * dx + dy * dy), 0.0), 1.0)
        ox, oy = ox - share * dx, oy - share * dy
        found[i] = sqrt(ox * ox + oy * oy)
    return found


def _scan_at_once(edges: Floats, near: Floats, x: float, y: float, c: float, s: float) -> Ranges:
    edges = edges[near <= RANGE_M]
    ox, oy, dx, dy = x - edges[:, 0, None], y - edges[:, 1, None], edges[:, 2, None], edges[:, 3, None]
    across = dx * oy - dy * ox
    bx, by = c * _COS - s * _SIN, s * _COS + c * _SIN
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = dy * bx - dx * by
        along = (oy * bx - ox * by) / scale
        ranges = across / scale
    ranges[~((across < 0.0) & (along >= 0.0) & (along <= 1.0) & (ranges > 0.0))] = RANGE_M
    return np.minimum(ranges.min(axis=0, initial=RANGE_M), RANGE_M)


@kernel_for(_scan_at_once)
def scan(edges: Floats, near: Floats, x: float, y: float, c: float, s: float) -> Ranges:
    """The range of each beam, [BEAMS].

    Args:
        near: the distance of each edge.
        c, s: cosine and sine of the robot's yaw.
    """
    found = np.full(BEAMS, RANGE_M)
    for k in range(len(edges)):
        ox, oy, dx, dy = x - edges[k, 0], y - edges[k, 1], edges[k, 2], edges[k, 3]
        across = dx * oy - dy * ox
        if near[k] > RANGE_M or across >= 0.0:
            continue
        for i in range(BEAMS):
            bx, by = c * _COS[i] - s * _SIN[i], s * _COS[i] + c * _SIN[i]
            scale = dy * bx - dx * by
            if scale == 0.0:
                continue
            along = (oy * bx - ox * by) / scale
            distance = across / scale
            if 0.0 <= along <= 1.0 and 0.0 < distance < found[i]:
                found[i] = distance
    return found


@kernel
def collides(edges: Floats, near: Floats, x: float, y: float, yaw: float) -> bool:
    """Whether the robot touches an edge. IR-SIM's robot is a polygon, which matters only within .25 mm."""
    nearest = near.min()
    if nearest > RADIUS_M:
        return False
    if nearest < RADIUS_M * cos(pi / _CORNERS):
        return True
    turn = 2.0 * pi / _CORNERS
    for k in range(_CORNERS):
        ax, ay = x + RADIUS_M * cos(yaw + k * turn), y + RADIUS_M * sin(yaw + k * turn)
        ux, uy = x + RADIUS_M * cos(yaw + (k + 1) * turn) - ax, y + RADIUS_M * sin(yaw + (k + 1) * turn) - ay
        for i in range(len(edges)):
            dx, dy = edges[i, 2], edges[i, 3]
            ox, oy = edges[i, 0] - ax, edges[i, 1] - ay
            scale = ux * dy - uy * dx
            if near[i] <= RADIUS_M and scale != 0.0:
                t, r = (ox * dy - oy * dx) / scale, (ox * uy - oy * ux) / scale
                if 0.0 <= t <= 1.0 and 0.0 <= r <= 1.0:
                    return True
    return False


def moved(x: float, y: float, yaw: float, v: float, w: float, period_s: float) -> tuple[float, float, float]:
    """The pose after a period at a velocity (m/s, rad/s), as IR-SIM's differential drive integrates it."""
    turned = yaw + w * period_s
    while turned > pi:
        turned -= 2.0 * pi
    while turned < -pi:
        turned += 2.0 * pi
    return x + cos(yaw) * v * period_s, y + sin(yaw) * v * period_s, turned
