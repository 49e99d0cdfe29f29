"""Subscribes to topics as a process of its own, and prints what came: python replay_listener.py '{"topics": ...}'.

{"topics": {"/world": "fbql_msgs/msg/WorldState"}, "expected": {"/world": 100}, "patience_s": 20}: it ends when as many
messages as expected have come, or after that time. On stdout: "ready" when it has subscribed, then one JSON object: for
each topic the SHA-256 of each message in the order they came (of topics in "read", which may be left out, that of what it
says), the stamps of /clock as [ns], and how the publishers offered their topics.
"""

from __future__ import annotations

import hashlib
import json
import sys
from functools import partial
from importlib import import_module
from time import monotonic
from typing import Any

import rclpy
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from rclpy.task import Future
from rosgraph_msgs.msg import Clock

DEPTH = 10_000
"""Nothing is lost here because this process is slow."""


def main() -> None:
    """Listens."""
    asked = json.loads(sys.argv[1])
    rclpy.init()
    node = Node("listener")
    came: dict[str, list[Any]] = {topic: [] for topic in (*asked["topics"], "/clock")}
    offers: dict[str, list[str]] = {}

    def hear(topic: str, kind: type, data: bytes) -> None:
        is_read = topic in asked.get("read", ())
        came[topic].append(read_hash(deserialize_message(data, kind)) if is_read else padded_hash(data))
        if topic not in offers:
            offers[topic] = [offered(info.qos_profile) for info in node.get_publishers_info_by_topic(topic)]

    def hear_clock(data: bytes) -> None:
        stamp = deserialize_message(data, Clock).clock
        came["/clock"].append(stamp.sec * 1_000_000_000 + stamp.nanosec)

    reliability = ReliabilityPolicy[asked.get("reliability", "RELIABLE")]
    qos = QoSProfile(depth=DEPTH, reliability=reliability)
    for topic, type_name in asked["topics"].items():
        package, _, name = type_name.split("/")
        kind = getattr(import_module(f"{package}.msg"), name)
        node.create_subscription(kind, topic, partial(hear, topic, kind), qos, raw=True)
    node.create_subscription(Clock, "/clock", hear_clock, QoSProfile(depth=DEPTH), raw=True)
    executor = EventsExecutor()
    executor.add_node(node)
    print("ready", flush=True)
    deadline = monotonic() + asked["patience_s"]
    while monotonic() < deadline and any(len(came[topic]) < count for topic, count in asked["expected"].items()):
        executor.spin_until_future_complete(Future(), timeout_sec=0.05)
    print(json.dumps({**came, "offers": offers}), flush=True)
    rclpy.try_shutdown()


def padded_hash(data: bytes) -> str:
    """SHA-256 of a message as it comes: the middleware pads it to 4 bytes."""
    return hashlib.sha256(data + bytes(-len(data) % 4)).hexdigest()


def read_hash(message: object) -> str:
    """SHA-256 of what a message says: its bytes have whatever was in memory between its fields."""
    return hashlib.sha256(repr(message).encode()).hexdigest()


def offered(qos: QoSProfile) -> str:
    """What others can know of a publisher's quality of service, in words."""
    return f"{qos.reliability.name} {qos.durability.name} deadline {qos.deadline.nanoseconds}".lower()


if __name__ == "__main__":
    main()
