"""Bags of a robot with a laser scanner, written by the library rosbags as rosbag2 writes them, in MCAP or SQLite 3."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import cos, sin
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

STORE = get_typestore(Stores.ROS2_JAZZY)
SCAN, ODOM, TWIST, STAMPED = (
    "sensor_msgs/msg/LaserScan",
    "nav_msgs/msg/Odometry",
    "geometry_msgs/msg/Twist",
    "geometry_msgs/msg/TwistStamped",
)
BEAMS = 12
"""Beams 0 to 3 look to the right, 8 to 11 to the left."""
SLOW, FAST, TURN = 0.2, 0.8, 1.0
SPEC = """
max_age_s: 0.3
observations:
  right_distance: {topic: /scan, field: "ranges[0:4].min", low: 0.0, high: 4.0, unit: m}
  left_distance: {topic: /scan, field: "ranges[8:12].min", low: 0.0, high: 4.0, unit: m}
command:
  topic: /cmd_vel
  axes:
    linear.x: {low: 0.0, high: 0.8, levels: 9}
    angular.z: {low: -1.5, high: 1.5, levels: 13}
"""
Message = tuple[str, str, int, Any]
"""Topic, type, time of recording [ns], message."""


def teleoperated(right_m: float, left_m: float) -> tuple[float, float]:
    """The rule that the bags show, linear.x and angular.z: slowly away from the near side, else fast straight on."""
    if right_m < 1.0:
        return SLOW, TURN
    return (SLOW, -TURN) if left_m < 1.0 else (FAST, 0.0)


def message(type_name: str, **fields: Any) -> Any:
    """A message with these fields, and 0 in the others."""
    return STORE.types[type_name](**fields)


def _vector(x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Any:
    return message("geometry_msgs/msg/Vector3", x=x, y=y, z=z)


def twist(linear_x: float, angular_z: float) -> Any:
    """A Twist."""
    return message(TWIST, linear=_vector(linear_x), angular=_vector(z=angular_z))


def header(stamp_ns: int) -> Any:
    """A header."""
    stamp = message("builtin_interfaces/msg/Time", sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9)
    return message("std_msgs/msg/Header", stamp=stamp, frame_id="base")


def stamped_twist(stamp_ns: int, linear_x: float, angular_z: float) -> Any:
    """A TwistStamped."""
    return message(STAMPED, header=header(stamp_ns), twist=twist(linear_x, angular_z))


def scan(stamp_ns: int, ranges: Sequence[float]) -> Any:
    """A LaserScan."""
    numbers = dict.fromkeys(
        ("angle_min", "angle_max", "angle_increment", "time_increment", "scan_time", "range_min", "range_max"), 0.0
    )
    return message(
        SCAN,
        header=header(stamp_ns),
        **numbers,
        ranges=np.array(ranges, np.float32),
        intensities=np.empty(0, np.float32),
    )


def odometry(stamp_ns: int, x: float, y: float, yaw: float) -> Any:
    """An Odometry."""
    pose = message(
        "geometry_msgs/msg/Pose",
        position=message("geometry_msgs/msg/Point", x=x, y=y, z=0.0),
        orientation=message("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=sin(yaw / 2), w=cos(yaw / 2)),
    )
    covariance = np.zeros(36)
    return message(
        ODOM,
        header=header(stamp_ns),
        child_frame_id="base",
        pose=message("geometry_msgs/msg/PoseWithCovariance", pose=pose, covariance=covariance),
        twist=message("geometry_msgs/msg/TwistWithCovariance", twist=twist(0.0, 0.0), covariance=covariance),
    )


@dataclass
class Drive:
    """A teleoperated drive, message by message."""

    messages: list[Message] = field(default_factory=list[Message])

    def add(self, topic: str, type_name: str, time_ns: int, content: Any) -> None:
        """Adds a message."""
        self.messages.append((topic, type_name, time_ns, content))


def drive(seed: int, moments: int = 400, stamped: bool = False) -> Drive:
    """A drive by the rule, at 10 Hz: a scan, odometry 1 ms later, the command 20 ms after the scan."""
    rng = np.random.default_rng(seed)
    made = Drive()
    for k in range(moments):
        now_ns = 10**9 + k * 10**8
        ranges = rng.uniform(0.2, 4.5, BEAMS).astype(np.float32)
        for side in (slice(0, 4), slice(8, 12)):  # as often near as far
            ranges[side] = rng.uniform(0.2, 2.5) + np.abs(rng.normal(0.0, 0.05, 4))
        made.add("/scan", SCAN, now_ns, scan(now_ns, ranges.tolist()))
        made.add("/odom", ODOM, now_ns + 10**6, odometry(now_ns, 0.1 * k, 1.0, 0.01 * k))
        command = teleoperated(float(ranges[0:4].min()), float(ranges[8:12].min()))
        time_ns = now_ns + 2 * 10**7
        if stamped:
            made.add("/cmd_vel", STAMPED, time_ns, stamped_twist(time_ns, *command))
        else:
            made.add("/cmd_vel", TWIST, time_ns, twist(*command))
    return made


def write_bag(path: Path, messages: Sequence[Message], storage: str = "mcap", compress: bool = False) -> Path:
    """Writes a bag; returns its directory."""
    plugin = StoragePlugin.MCAP if storage == "mcap" else StoragePlugin.SQLITE3
    writer = Writer(path, version=9, storage_plugin=plugin)
    if compress:
        writer.set_compression(CompressionMode.MESSAGE, CompressionFormat.ZSTD)
    with writer:
        connections: dict[str, Any] = {}
        for topic, type_name, time_ns, content in messages:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, type_name, typestore=STORE)
            writer.write(connections[topic], time_ns, STORE.serialize_cdr(content, type_name))
    return path
