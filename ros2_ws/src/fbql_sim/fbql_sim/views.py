"""Topics for ROS tools: poses, /clock, markers, diagnostics; published for subscribers only, or always in real time."""

from __future__ import annotations

from collections.abc import Mapping
from math import cos, sin

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from fbql_common.core.field import BALL_RADIUS_M, FIELD, ROBOT_SIDE_M
from fbql_common.core.topic_names import BALL_POSE, CLOCK, DIAGNOSTICS, ROBOT_POSE, WALL_POSE
from fbql_common.core.types import FIELD_FRAME, World
from fbql_common.qos import POSE_QOS
from fbql_common.wire import NS
from geometry_msgs.msg import Point, PoseStamped
from rclpy.node import Node
from rosgraph_msgs.msg import Clock
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker, MarkerArray

from fbql_sim.core.arena import SEGMENTS

_WALL_M = 0.05
_ORANGE = (1.0, 0.5, 0.0)
_BLUE = (0.15, 0.35, 0.9)
_YELLOW = (0.95, 0.8, 0.1)
_WHITE = (0.9, 0.9, 0.9)
_GREEN = (0.1, 0.35, 0.15)


def _stamp(stamp_ns: int) -> Time:
    return Time(sec=int(stamp_ns // NS), nanosec=int(stamp_ns % NS))


def pose_msg(stamp_ns: int, x_m: float, y_m: float, yaw_rad: float) -> PoseStamped:
    """A pose in the plane, in the frame "field"."""
    message = PoseStamped()
    message.header.stamp = _stamp(stamp_ns)
    message.header.frame_id = FIELD_FRAME
    message.pose.position.x = float(x_m)
    message.pose.position.y = float(y_m)
    message.pose.orientation.z = float(sin(yaw_rad / 2))
    message.pose.orientation.w = float(cos(yaw_rad / 2))
    return message


def pose_msgs(world: World) -> tuple[PoseStamped, PoseStamped, PoseStamped]:
    """The poses of robot, ball and closest wall point."""
    return (
        pose_msg(world.stamp_ns, world.robot_x_m, world.robot_y_m, world.robot_yaw_rad),
        pose_msg(world.stamp_ns, world.ball_x_m, world.ball_y_m, 0.0),
        pose_msg(world.stamp_ns, world.wall_x_m, world.wall_y_m, world.wall_yaw_rad),
    )


class Views:
    """Publishes the views of a world state.

    Args:
        always: publish poses and clock of every world state (real time); otherwise only topics with a subscriber, as of the
            last refresh(). Markers, which cost more than the rest together, are published for subscribers only.
    """

    def __init__(self, node: Node, always: bool) -> None:
        self._node = node
        self._always = always
        self._poses = [
            node.create_publisher(PoseStamped, topic, POSE_QOS) for topic in (ROBOT_POSE, BALL_POSE, WALL_POSE)
        ]
        self._clock = node.create_publisher(Clock, CLOCK, POSE_QOS)
        self._markers = node.create_publisher(MarkerArray, "~/markers", POSE_QOS)
        self._diagnostics = node.create_publisher(DiagnosticArray, DIAGNOSTICS, POSE_QOS)
        self._show_poses = self._show_clock = always
        self._show_markers = False
        self._refreshes = 0

    def refresh(self, counts: Mapping[str, int]) -> None:
        """Updates which topics have subscribers; call it a few times a second. Publishes the counts, in lockstep every
        fourth time."""
        self._show_poses = self._always or any(publisher.get_subscription_count() for publisher in self._poses)
        self._show_clock = self._always or self._clock.get_subscription_count() > 0
        self._show_markers = self._markers.get_subscription_count() > 0
        self._refreshes += 1
        if self._always or self._refreshes % 4 == 0:
            self._diagnostics.publish(self._diagnostics_msg(counts))

    def show(self, world: World) -> None:
        """Publishes the topics that have subscribers."""
        if self._show_clock:
            self._clock.publish(Clock(clock=_stamp(world.stamp_ns)))
        if self._show_poses:
            for publisher, pose in zip(self._poses, pose_msgs(world), strict=True):
                publisher.publish(pose)
        if self._show_markers:
            self._markers.publish(markers_msg(world))

    def _diagnostics_msg(self, counts: Mapping[str, int]) -> DiagnosticArray:
        troubled = counts["missed_ticks"] or counts["commands_dropped"]
        status = DiagnosticStatus(
            level=DiagnosticStatus.WARN if troubled else DiagnosticStatus.OK,
            name=f"{self._node.get_fully_qualified_name()[1:]}: world",
            message=f"episode {counts['episode']}, step {counts['step']}",
            hardware_id="simulation",
            values=[KeyValue(key=key, value=str(value)) for key, value in counts.items()],
        )
        message = DiagnosticArray(status=[status])
        message.header.stamp = self._node.get_clock().now().to_msg()
        return message


def markers_msg(world: World) -> MarkerArray:
    """Field, walls, robot, ball and closest wall point for RViz and Foxglove."""
    header = Header(stamp=_stamp(world.stamp_ns), frame_id=FIELD_FRAME)
    ground = _marker(
        header, "ground", Marker.CUBE, _GREEN, (FIELD.length_m, FIELD.width_m, 0.002), (0.0, 0.0, -0.002, 0.0)
    )
    walls = _marker(header, "walls", Marker.LINE_LIST, _WHITE, (0.01, 0.0, 0.0), (0.0, 0.0, _WALL_M / 2, 0.0))
    walls.points = [Point(x=float(x_m), y=float(y_m)) for segment in SEGMENTS for x_m, y_m in segment]
    robot = (world.robot_x_m, world.robot_y_m, ROBOT_SIDE_M / 2, world.robot_yaw_rad)
    heading = (world.robot_x_m, world.robot_y_m, ROBOT_SIDE_M, world.robot_yaw_rad)
    ball = (world.ball_x_m, world.ball_y_m, BALL_RADIUS_M, 0.0)
    wall = (world.wall_x_m, world.wall_y_m, _WALL_M / 2, world.wall_yaw_rad)
    return MarkerArray(
        markers=[
            ground,
            walls,
            _marker(header, "robot", Marker.CUBE, _BLUE, (ROBOT_SIDE_M,) * 3, robot),
            _marker(header, "heading", Marker.ARROW, _WHITE, (ROBOT_SIDE_M, 0.015, 0.015), heading),
            _marker(header, "ball", Marker.SPHERE, _ORANGE, (2 * BALL_RADIUS_M,) * 3, ball),
            _marker(header, "wall_point", Marker.ARROW, _YELLOW, (0.06, 0.01, 0.01), wall),
        ]
    )


def _marker(
    header: Header,
    namespace: str,
    kind: int,
    color: tuple[float, float, float],
    scale_m: tuple[float, ...],
    pose: tuple[float, float, float, float],
) -> Marker:
    x, y, z, yaw = pose
    marker = Marker(header=header, ns=namespace, id=0, type=int(kind), action=Marker.ADD)
    marker.color = ColorRGBA(r=float(color[0]), g=float(color[1]), b=float(color[2]), a=1.0)
    marker.scale.x, marker.scale.y, marker.scale.z = (float(size) for size in scale_m)
    marker.pose.position.x, marker.pose.position.y, marker.pose.position.z = float(x), float(y), float(z)
    marker.pose.orientation.z, marker.pose.orientation.w = float(sin(yaw / 2)), float(cos(yaw / 2))
    return marker
