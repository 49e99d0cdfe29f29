"""A ROS node of somebody else's: `python foreign_listener.py OUT` writes as JSON, again and again, what it sees of a graph:
the names of nodes, and the number of world messages."""

import json
import sys
from pathlib import Path

import rclpy
from fbql_msgs.msg import WorldState
from rclpy.node import Node


def main(out: Path) -> None:
    """Listens until it is killed."""
    rclpy.init()
    node = Node("listener")
    heard: list[WorldState] = []
    node.create_subscription(WorldState, "/world", heard.append, 10)
    seen: set[str] = set()
    part = out.with_suffix(".part")
    while True:
        for _ in range(20):
            rclpy.spin_once(node, timeout_sec=0.01)
        seen |= set(node.get_node_names()) - {"listener"}
        part.write_text(json.dumps({"nodes": sorted(seen), "worlds": len(heard)}))
        part.replace(out)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
