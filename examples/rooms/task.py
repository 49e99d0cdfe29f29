"""The task of a robot that drives to and fro between two places: publishes where its goal is, and when it was reached or missed.

    python examples/rooms/task.py --ros-args -p there_x_m:=8.0 -p there_y_m:=7.0 -p here_x_m:=1.5 -p here_y_m:=2.0

Subscribes to /odom and /scan; publishes /goal (distance x [m], bearing y [rad, left positive]) and `outcome`, from which a mux learns. Each
drive is an episode: it ends with success, with a collision, or when its time is up, and the next one begins where the robot is.

Owns: the goals and the rewards. Does not own: the robot.
"""

import sys
from dataclasses import dataclass
from math import atan2, hypot, inf

from fbql_common.core.geometry import wrap_bearing
from fbql_common.core.mux_types import RobotOutcome
from fbql_common.core.parameters import parameter
from fbql_common.core.topic_names import OUTCOME
from fbql_common.declare import declare_parameters
from fbql_common.qos import STEP_QOS
from fbql_common.spin import GraphNode, spin
from fbql_common.wire import MESSAGES, encode_outcome
from geometry_msgs.msg import Vector3Stamped
from nav_msgs.msg import Odometry
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import LaserScan
from sensors import goal_at

REACHED, COLLIDED = 10.0, -10.0


@dataclass(frozen=True)
class TaskParameters:
    """Parameters of the task."""

    there_x_m: float = parameter(0.0, "the first goal, in the frame of the odometry", unit="m", required=True)
    there_y_m: float = parameter(0.0, "the first goal", unit="m", required=True)
    here_x_m: float = parameter(0.0, "the second goal", unit="m")
    here_y_m: float = parameter(0.0, "the second goal", unit="m")
    radius_m: float = parameter(0.3, "the goal is reached within this distance", unit="m", low=0.01, high=100.0)
    collision_m: float = parameter(
        0.22, "something nearer to the scanner than this is a collision", unit="m", low=0.0, high=10.0
    )
    limit_s: float = parameter(60.0, "time limit of an episode", unit="s", low=1.0, high=1e6)


class TaskNode(GraphNode):
    """The task as a node."""

    def __init__(self, **options) -> None:
        super().__init__("task", **options)
        self._parameters = declare_parameters(self, TaskParameters)
        places = self._parameters
        self._goals = ((places.there_x_m, places.there_y_m), (places.here_x_m, places.here_y_m))
        self._index = 0
        self._nearest_m = inf
        self._touches = False
        self._begun_ns = 0
        self._goal_publisher = self.create_publisher(Vector3Stamped, "goal", qos_profile_sensor_data)
        self._outcome_publisher = self.create_publisher(MESSAGES[RobotOutcome], OUTCOME, STEP_QOS)
        self.create_subscription(LaserScan, "scan", self._on_scan, qos_profile_sensor_data)
        self.create_subscription(Odometry, "odom", self._on_odometry, qos_profile_sensor_data)

    def _on_scan(self, scan: LaserScan) -> None:
        self._nearest_m = min((value for value in scan.ranges if value >= scan.range_min), default=inf)

    def _on_odometry(self, odometry: Odometry) -> None:
        now_ns = self.get_clock().now().nanoseconds
        self._begun_ns = self._begun_ns or now_ns
        position, turn = odometry.pose.pose.position, odometry.pose.pose.orientation
        yaw = atan2(2.0 * (turn.w * turn.z + turn.x * turn.y), 1.0 - 2.0 * (turn.y * turn.y + turn.z * turn.z))
        x, y = self._goals[self._index]
        distance = hypot(x - position.x, y - position.y)
        touched, self._touches = self._touches, self._nearest_m < self._parameters.collision_m
        if self._touches and not touched:
            self._end(now_ns, RobotOutcome(now_ns, COLLIDED, terminated=True, outcome="collision"))
        elif distance <= self._parameters.radius_m:
            self._index = 1 - self._index
            self._end(now_ns, RobotOutcome(now_ns, REACHED, terminated=True, outcome="success"))
        elif now_ns - self._begun_ns > self._parameters.limit_s * 1e9:
            self._end(now_ns, RobotOutcome(now_ns, 0.0, truncated=True))
        else:
            self._goal_publisher.publish(
                goal_at(distance, wrap_bearing(atan2(y - position.y, x - position.x) - yaw), now_ns)
            )

    def _end(self, now_ns: int, outcome: RobotOutcome) -> None:
        self._begun_ns = now_ns
        self._outcome_publisher.publish(encode_outcome(outcome))
        how = outcome.outcome or "time is up"
        self.get_logger().info(f"{how}; the goal is now {self._goals[self._index]}")


if __name__ == "__main__":
    sys.exit(spin([TaskNode]))
