"""A robot in a room, in real time: /scan and /odom out, /cmd_vel in. It stands in for yours in docs/your-own-robot.md.

    python examples/rooms/robot.py --ros-args -p room:=7

It stops when commands stop. When it has run into something, it is put back to its start.

Owns: the room. Does not own: any goal.
"""

import sys
from dataclasses import dataclass
from time import monotonic

from fbql_common.core.parameters import parameter
from fbql_common.core.topic_names import CMD_VEL
from fbql_common.core.twist import Twist
from fbql_common.declare import declare_parameters
from fbql_common.inputs import Input
from fbql_common.qos import COMMAND_QOS
from fbql_common.spin import GraphNode, spin
from fbql_common.watch import steady_timer
from fbql_common.wire import decode_twist
from fbql_studies.rooms.maps import FAMILIES, room_of
from fbql_studies.rooms.robot import PERIOD_S
from fbql_studies.rooms.worlds import IrSimWorld
from nav_msgs.msg import Odometry
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import LaserScan
from sensors import odometry_of, scan_of

_COMMAND_TIMEOUT_S = 0.5


@dataclass(frozen=True)
class RobotParameters:
    """Parameters of the robot."""

    family: str = parameter("traps", "family of rooms", choices=list(FAMILIES))
    room: int = parameter(0, "seed of the room", low=0, high=2**31)


class Robot(GraphNode):
    """The robot."""

    def __init__(self, **options) -> None:
        super().__init__("robot", **options)
        parameters = declare_parameters(self, RobotParameters)
        self._room = room_of(parameters.family, parameters.room)
        self._world = IrSimWorld()
        self._reading = self._world.reset(self._room)
        self._twist, self._heard_s = Twist(), monotonic()
        self._scans = self.create_publisher(LaserScan, "scan", qos_profile_sensor_data)
        self._odometry = self.create_publisher(Odometry, "odom", qos_profile_sensor_data)
        self._commands = Input(self, Twist, CMD_VEL, decode_twist, self._on_command, COMMAND_QOS)
        self._timer = steady_timer(self, PERIOD_S, self._step)
        (x, y, _), goal = self._room.start, self._room.goal
        self.get_logger().info(
            f"at ({x:.2f}, {y:.2f}); the other side of the room is at ({goal[0]:.2f}, {goal[1]:.2f})"
        )

    def _on_command(self, twist: Twist, _data: bytes) -> None:
        self._twist, self._heard_s = twist, monotonic()

    def _step(self) -> None:
        if self._reading.collided:
            self.get_logger().info("ran into something, and is put back to its start")
            self._reading = self._world.reset(self._room)
        else:
            twist = self._twist if monotonic() - self._heard_s < _COMMAND_TIMEOUT_S else Twist()
            self._reading = self._world.step(twist.linear_x_m_s, twist.angular_z_rad_s)
        now_ns = self.get_clock().now().nanoseconds
        self._scans.publish(scan_of(self._reading, now_ns))
        self._odometry.publish(odometry_of(self._reading, now_ns))


if __name__ == "__main__":
    sys.exit(spin([Robot]))
