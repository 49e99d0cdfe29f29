"""Plane geometry of robot, ball, wall and goal. Angles in radians, counter-clockwise positive (REP-103).

Headings are in (-pi, pi]. Bearings and the approach angle are in [-pi, pi), because regions of a tree are half-open: the
root region of such a feature, [-pi, pi), holds every value.
"""

from __future__ import annotations

from math import atan2, hypot, pi, remainder, tau

from fbql_common.core.field import FIELD
from fbql_common.core.types import World

DETOUR_RADIUS_M = 0.09
"""Radius of the detour round the ball [m]."""
DETOUR_GAIN = 2.5
"""How far the detour leads away from the ball for a small psi [1]; above 1, or psi never shrinks."""


def wrap_angle(angle_rad: float) -> float:
    """The same direction in (-pi, pi] [rad]."""
    wrapped = remainder(angle_rad, tau)
    return pi if wrapped == -pi else wrapped


def wrap_bearing(angle_rad: float) -> float:
    """The same direction in [-pi, pi) [rad]."""
    wrapped = remainder(angle_rad, tau)
    return wrapped if wrapped < pi else -pi


# The functions below run at every step, so they spell out `wrap_bearing` instead of calling it, or each other.


def distance_and_bearing(world: World, x_m: float, y_m: float) -> tuple[float, float]:
    """Distance from the robot's center to a point [m], and its bearing from the robot's heading, in [-pi, pi) [rad]."""
    dx, dy = x_m - world.robot_x_m, y_m - world.robot_y_m
    bearing = remainder(atan2(dy, dx) - world.robot_yaw_rad, tau)
    return hypot(dx, dy), bearing if bearing < pi else -pi


def ball_distance_and_bearing(world: World) -> tuple[float, float]:
    """Distance d [m] and bearing theta [rad] of the ball (the paper's Fig. 6)."""
    dx, dy = world.ball_x_m - world.robot_x_m, world.ball_y_m - world.robot_y_m
    bearing = remainder(atan2(dy, dx) - world.robot_yaw_rad, tau)
    return hypot(dx, dy), bearing if bearing < pi else -pi


def wall_distance_and_bearing(world: World) -> tuple[float, float]:
    """Distance [m] and bearing [rad] of the closest point of the walls (the paper's Fig. 7)."""
    dx, dy = world.wall_x_m - world.robot_x_m, world.wall_y_m - world.robot_y_m
    bearing = remainder(atan2(dy, dx) - world.robot_yaw_rad, tau)
    return hypot(dx, dy), bearing if bearing < pi else -pi


def approach_angle(world: World) -> float:
    """psi: the angle from the line robot -> ball to the line ball -> goal, in [-pi, pi) [rad] (Fig. 8).

    0 when the robot stands behind the ball, in line with the center of the goal that is attacked.
    """
    to_ball = atan2(world.ball_y_m - world.robot_y_m, world.ball_x_m - world.robot_x_m)
    psi = remainder(atan2(-world.ball_y_m, FIELD.half_length_m - world.ball_x_m) - to_ball, tau)
    return psi if psi < pi else -pi
