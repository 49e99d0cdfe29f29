"""The messages that the robot of the rooms publishes of a reading: a LaserScan, an Odometry, and where its goal is."""

from math import cos, inf, sin

import numpy as np
from fbql_studies.rooms.robot import ANGLES, BEAM_RAD, PERIOD_S, RANGE_M, Reading
from geometry_msgs.msg import Vector3Stamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import LaserScan


def stamped(message, now_ns: int, frame: str = "base_link"):
    """A message with its header."""
    message.header.frame_id = frame
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(now_ns, 10**9)
    return message


def scan_of(reading: Reading, now_ns: int) -> LaserScan:
    """The scan, from behind counterclockwise; +Inf where nothing is in range."""
    scan = LaserScan(range_max=RANGE_M, scan_time=PERIOD_S, angle_increment=BEAM_RAD)
    scan.angle_min, scan.angle_max = float(ANGLES[0]), float(ANGLES[-1])
    scan.ranges = np.where(reading.ranges < RANGE_M, reading.ranges, inf).tolist()
    return stamped(scan, now_ns)


def odometry_of(reading: Reading, now_ns: int) -> Odometry:
    """The pose; this robot's odometry does not drift."""
    odometry = Odometry(child_frame_id="base_link")
    pose = odometry.pose.pose
    pose.position.x, pose.position.y = reading.x_m, reading.y_m
    pose.orientation.z, pose.orientation.w = sin(reading.yaw_rad / 2), cos(reading.yaw_rad / 2)
    return stamped(odometry, now_ns, "odom")


def goal_at(distance_m: float, bearing_rad: float, now_ns: int) -> Vector3Stamped:
    """Distance (x) and bearing (y, left positive) of the goal."""
    goal = Vector3Stamped()
    goal.vector.x, goal.vector.y = distance_m, bearing_rad
    return stamped(goal, now_ns)
