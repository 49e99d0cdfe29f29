"""Velocity commands of any robot (geometry_msgs/Twist and TwistStamped), flat and in SI units, in the robot's frame."""

from __future__ import annotations

from typing import NamedTuple


class Twist(NamedTuple):
    """A velocity command: linear and angular velocity along and about x (forward), y (to the left) and z (up)."""

    linear_x_m_s: float = 0.0
    linear_y_m_s: float = 0.0
    linear_z_m_s: float = 0.0
    angular_x_rad_s: float = 0.0
    angular_y_rad_s: float = 0.0
    angular_z_rad_s: float = 0.0


class StampedTwist(NamedTuple):
    """A velocity command with the header that it came with."""

    stamp_ns: int
    frame: str
    twist: Twist
