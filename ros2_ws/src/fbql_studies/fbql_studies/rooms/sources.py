"""The five sources of velocity commands: simple, and none of them gets far alone. Each always has a command.

A source is a function of a scan and of the goal's distance and bearing, and returns (linear.x [m/s], angular.z [rad/s]). None
but `go_to_goal` knows where the goal is, and `go_to_goal` does not see obstacles.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import atan2, cos, pi, radians, sin

from fbql_common.core.kernels import kernel, kernel_for

from fbql_studies.rooms.robot import BEAM_RAD, BEAMS, RANGE_M, Ranges, Reading

FAST_M_S, SLOW_M_S, BACK_M_S, TURN_RAD_S = 0.8, 0.6, 0.3, 1.5
STOP_M = 0.35
"""From the robot's center: the gap and wall followers go no nearer to obstacles ahead."""
FREE_M = 1.0
"""A beam longer than this belongs to a gap."""
WALL_M = 0.5
"""The distance that the wall followers keep."""
LOST_M = 1.2
"""A wall farther away than this is not followed."""
AHEAD = BEAMS // 2
"""Index of the beam straight ahead; the one to the left of it has the next index."""
_QUARTER = BEAMS // 4
_SKEW_RAD = radians(40.0)
SECTORS_DEG = ((-110, -65), (-60, -25), (-20, 20), (25, 60), (65, 110))
"""The five sectors that the mux senses, from right to left, both ends included [degrees]."""

Command = tuple[float, float]
Source = Callable[[Ranges, float, float], Command]
Observed = tuple[tuple[float, ...], ...]


@kernel_for(lambda ranges, first, last: float(ranges[first : last + 1].min()))
def nearest(ranges: Ranges, first: int, last: int) -> float:
    """The nearest range of these beams, both ends included."""
    found = ranges[first]
    for i in range(first + 1, last + 1):
        if ranges[i] < found:
            found = ranges[i]
    return found


@kernel
def sectors(ranges: Ranges) -> tuple[float, float, float, float, float]:
    """The nearest range in each of SECTORS_DEG."""
    return (
        nearest(ranges, AHEAD - 22, AHEAD - 13),
        nearest(ranges, AHEAD - 12, AHEAD - 5),
        nearest(ranges, AHEAD - 4, AHEAD + 4),
        nearest(ranges, AHEAD + 5, AHEAD + 12),
        nearest(ranges, AHEAD + 13, AHEAD + 22),
    )


@kernel
def way_to_goal(ranges: Ranges, distance: float, bearing: float) -> float:
    """How far the way straight to the goal is free: the nearest range within 20 degrees of it, RANGE_M if the goal is nearer."""
    middle = int((bearing + pi) / BEAM_RAD + 0.5)
    found = RANGE_M
    for k in range(-4, 5):
        found = min(found, ranges[(middle + k) % BEAMS])
    return RANGE_M if found > distance else found


@kernel
def _clip(x: float, limit: float) -> float:
    return min(max(x, -limit), limit)


@kernel
def _freer_side(ranges: Ranges) -> float:
    """1 if there is more room on the front left, -1 if on the front right."""
    surplus = 0.0
    for k in range(1, _QUARTER + 1):
        surplus += ranges[AHEAD + k] - ranges[AHEAD - k]
    return 1.0 if surplus >= 0.0 else -1.0


@kernel
def go_to_goal(ranges: Ranges, distance: float, bearing: float) -> Command:
    """Turns towards the goal and drives there, whatever is in the way."""
    return FAST_M_S * max(cos(bearing), 0.0), _clip(2.0 * bearing, TURN_RAD_S)


@kernel
def follow_gap(ranges: Ranges, distance: float, bearing: float) -> Command:
    """Heads for the middle of the widest gap ahead, slower where there is less room."""
    width, heading, first = 0, 0.0, -1
    for i in range(AHEAD - _QUARTER, AHEAD + _QUARTER + 2):
        if i <= AHEAD + _QUARTER and ranges[i] > FREE_M:
            if first < 0:
                first = i
        elif first >= 0:
            middle = BEAM_RAD * ((first + i - 1) / 2.0 - AHEAD)
            if i - first > width or (i - first == width and abs(middle) < abs(heading)):
                width, heading = i - first, middle
            first = -1
    if width == 0:
        return 0.0, 1.2 * _freer_side(ranges)
    room = nearest(ranges, AHEAD - 12, AHEAD + 12) - STOP_M
    return FAST_M_S * min(max(room, 0.0), 1.0) * max(cos(heading), 0.0), _clip(2.0 * heading, TURN_RAD_S)


@kernel
def _follow_wall(ranges: Ranges, side: int) -> Command:
    """Keeps a wall on its left (side 1) or right (-1): goes round its end, and straight on where no wall is found."""
    ahead = nearest(ranges, AHEAD - 4, AHEAD + 4)
    skew = nearest(ranges, AHEAD + 6, AHEAD + 9) if side > 0 else nearest(ranges, AHEAD - 9, AHEAD - 6)
    ahead = min(ahead, skew)
    if ahead < WALL_M + 0.1:
        return min(max(ahead - STOP_M, 0.0), 0.2), -1.2 * side
    wall = nearest(ranges, AHEAD + 13, AHEAD + 22) if side > 0 else nearest(ranges, AHEAD - 22, AHEAD - 13)
    if wall > LOST_M:
        passed = nearest(ranges, AHEAD + 23, AHEAD + 30) if side > 0 else nearest(ranges, AHEAD - 30, AHEAD - 23)
        return SLOW_M_S, 1.0 * side if passed < LOST_M else 0.0
    beside, before = ranges[AHEAD + side * _QUARTER], ranges[AHEAD + side * 10]
    slope = atan2(before * cos(_SKEW_RAD) - beside, before * sin(_SKEW_RAD))
    soon = min(beside * cos(slope) + 0.5 * sin(slope), wall + 0.3)
    return SLOW_M_S, side * min(max(2.5 * (soon - WALL_M), -1.2), 1.0)


@kernel
def follow_wall_left(ranges: Ranges, distance: float, bearing: float) -> Command:
    """Keeps a wall on its left, and goes round its end."""
    return _follow_wall(ranges, 1)


@kernel
def follow_wall_right(ranges: Ranges, distance: float, bearing: float) -> Command:
    """Keeps a wall on its right, and goes round its end."""
    return _follow_wall(ranges, -1)


@kernel
def back_up(ranges: Ranges, distance: float, bearing: float) -> Command:
    """Drives back while there is room behind, and turns its nose to the freer side."""
    behind = min(nearest(ranges, 0, 8), nearest(ranges, BEAMS - 8, BEAMS - 1))
    return -BACK_M_S if behind > STOP_M else 0.0, 0.6 * _freer_side(ranges)


SOURCES: Mapping[str, Source] = {
    "goal": go_to_goal,
    "gap": follow_gap,
    "wall_left": follow_wall_left,
    "wall_right": follow_wall_right,
    "back": back_up,
}


def observe(reading: Reading) -> Observed:
    """What the mux senses, in six groups: distance and bearing of the goal, and the nearest range in each of five sectors."""
    right, front_right, front, front_left, left = sectors(reading.ranges)
    goal = (reading.goal_distance_m, reading.goal_bearing_rad)
    return goal, (right,), (front_right,), (front,), (front_left,), (left,)
