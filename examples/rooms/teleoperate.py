"""Records bags of a scripted operator who drives the robot through rooms with a keyboard (fbql_studies.rooms.teleoperation).

    python examples/rooms/teleoperate.py drives --rooms 12
    python3 scripts/induce.py way_round --bag drives/traps_700000 --spec examples/rooms/behavior.yaml --out way_round.json

with a --bag for each drive

Needs the extra `bags`. Your own robot is recorded with `ros2 bag record /scan /goal /cmd_vel`.
"""

import argparse
from math import inf
from pathlib import Path

import numpy as np
from fbql_studies.rooms.maps import room_of
from fbql_studies.rooms.robot import PERIOD_S, RANGE_M, Reading
from fbql_studies.rooms.teleoperation import Operator
from fbql_studies.rooms.worlds import TwinWorld
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

FIRST_ROOM = 700_000
"""No study and no training has these rooms."""
STORE = get_typestore(Stores.ROS2_JAZZY)
TOPICS = {
    "/scan": "sensor_msgs/msg/LaserScan",
    "/goal": "geometry_msgs/msg/Vector3Stamped",
    "/cmd_vel": "geometry_msgs/msg/Twist",
}
DELAY_NS = 20_000_000
"""From a scan to the key."""


def make(kind: str, **fields):
    """A message."""
    return STORE.types[kind](**fields)


def vector(x: float = 0.0, y: float = 0.0, z: float = 0.0):
    """A Vector3."""
    return make("geometry_msgs/msg/Vector3", x=x, y=y, z=z)


def messages_of(reading: Reading, command: tuple[float, float], now_ns: int) -> dict:
    """What is recorded of one moment: topic -> message."""
    stamp = make("builtin_interfaces/msg/Time", sec=now_ns // 10**9, nanosec=now_ns % 10**9)
    header = make("std_msgs/msg/Header", stamp=stamp, frame_id="base_link")
    zeros = dict.fromkeys(
        ("angle_min", "angle_max", "angle_increment", "time_increment", "scan_time", "range_min", "range_max"), 0.0
    )
    ranges = np.where(reading.ranges < RANGE_M, reading.ranges, inf).astype(np.float32)
    scan = make(TOPICS["/scan"], header=header, **zeros, ranges=ranges, intensities=np.empty(0, np.float32))
    goal = vector(reading.goal_distance_m, reading.goal_bearing_rad)
    twist = make(TOPICS["/cmd_vel"], linear=vector(command[0]), angular=vector(z=command[1]))
    return {"/scan": scan, "/goal": make(TOPICS["/goal"], header=header, vector=goal), "/cmd_vel": twist}


def record(path: Path, family: str, seed: int) -> bool:
    """Records one drive; whether it reached the goal."""
    room, world = room_of(family, seed), TwinWorld()
    operator, reading = Operator(room), world.reset(room)
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        channels = {topic: writer.add_connection(topic, kind, typestore=STORE) for topic, kind in TOPICS.items()}
        while not (reading.terminated or reading.truncated):
            command = operator.keys(reading)
            now_ns = 10**9 + round(reading.step * PERIOD_S * 1e9)
            for topic, message in messages_of(reading, command, now_ns).items():
                at_ns = now_ns + (DELAY_NS if topic == "/cmd_vel" else 0)
                writer.write(channels[topic], at_ns, STORE.serialize_cdr(message, TOPICS[topic]))
            reading = world.step(*command)
    return reading.reached


def main() -> None:
    """Records."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path, help="directory of the bags, a new one")
    parser.add_argument("--rooms", type=int, default=12, help="rooms to drive through (12)")
    parser.add_argument("--family", choices=["traps", "doors"], default="traps", help="family of rooms (traps)")
    options = parser.parse_args()
    try:
        options.out.mkdir(parents=True)
    except OSError as error:
        parser.error(f"{options.out}: {error.strerror}; choose a new directory")
    reached = sum(
        record(options.out / f"{options.family}_{seed}", options.family, seed)
        for seed in range(FIRST_ROOM, FIRST_ROOM + options.rooms)
    )
    print(f"{reached} of {options.rooms} goals reached; bags in {options.out}")


if __name__ == "__main__":
    main()
