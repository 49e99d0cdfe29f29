"""Sources as ordinary nodes: /scan and /goal in, velocity commands out.

    python examples/rooms/source.py goal gap wall_left wall_right back

Owns: nothing but its rule (`fbql_studies.rooms.sources`). It answers every scan, whoever drives.
"""

import sys

import numpy as np
from fbql_common.qos import COMMAND_QOS
from fbql_common.spin import BAD_INPUT, GraphNode, spin
from fbql_studies.rooms.robot import RANGE_M
from fbql_studies.rooms.sources import SOURCES
from geometry_msgs.msg import Twist, Vector3Stamped
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import LaserScan


class SourceNode(GraphNode):
    """A source, by its name in SOURCES. Publishes on NAME_vel."""

    def __init__(self, name: str, **options) -> None:
        super().__init__(name, **options)
        self._source = SOURCES[name]
        self._goal: Vector3Stamped | None = None
        self._publisher = self.create_publisher(Twist, f"{name}_vel", COMMAND_QOS)
        self.create_subscription(Vector3Stamped, "goal", self._on_goal, qos_profile_sensor_data)
        self.create_subscription(LaserScan, "scan", self._on_scan, qos_profile_sensor_data)

    def _on_goal(self, goal: Vector3Stamped) -> None:
        self._goal = goal

    def _on_scan(self, scan: LaserScan) -> None:
        if self._goal is None:
            return
        ranges = np.minimum(np.asarray(scan.ranges, dtype=np.float64), RANGE_M)  # +Inf: nothing in range
        twist = Twist()
        twist.linear.x, twist.angular.z = map(float, self._source(ranges, self._goal.vector.x, self._goal.vector.y))
        self._publisher.publish(twist)


if __name__ == "__main__":
    names, ros = sys.argv[1:], []
    if "--ros-args" in names:
        names, ros = names[: names.index("--ros-args")], names[names.index("--ros-args") :]
    if not names or not set(names) <= SOURCES.keys():
        print(f"source.py: name sources, out of: {', '.join(SOURCES)}", file=sys.stderr)
        sys.exit(BAD_INPUT)
    sys.exit(spin([lambda name=name: SourceNode(name) for name in names], [sys.argv[0], *ros]))
