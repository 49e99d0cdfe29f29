"""Recorded topics as publishers: message classes, quality of service, and views made of the world states."""

from __future__ import annotations

from collections.abc import Collection
from copy import copy
from pathlib import Path
from time import monotonic
from typing import Any

from ament_index_python.packages import get_package_share_directory
from fbql_common.core.cdr import Malformed
from fbql_common.core.errors import BadInput
from fbql_common.core.topic_names import BALL_POSE, ROBOT_POSE, WALL_POSE, WORLD
from fbql_common.message_types import is_message_type, message_class
from fbql_common.qos import POSE_QOS, STEP_QOS
from fbql_recording.bag_metadata import INFINITE_NS
from fbql_recording.mcap.reader import Topic
from fbql_recording.message_definitions import essence, schema_text, type_hash
from fbql_recording.plain_yaml import from_yaml
from fbql_recording.run import Run
from fbql_sim.views import markers_msg, pose_msgs
from geometry_msgs.msg import PoseStamped
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, HistoryPolicy, LivelinessPolicy, QoSProfile, ReliabilityPolicy
from visualization_msgs.msg import MarkerArray

MARKERS = "simulator/markers"
_WORLD_TYPE = "fbql_msgs/msg/WorldState"
_POSES = (ROBOT_POSE, BALL_POSE, WALL_POSE)
_LOOK_S = 0.25
"""Time between two checks of who subscribes [s]."""


def class_of(topic: Topic) -> type[Any]:
    """The message class of a recorded topic. Nothing is imported but an installed message package that has the type.

    Raises:
        BadInput: it is no message type, not installed, or installed with other fields than were recorded: subscribers
            would misread the recorded bytes.
    """
    if topic.message_encoding != "cdr":
        raise BadInput(f"{topic.name} is recorded as '{topic.message_encoding}', not as cdr")
    if not is_message_type(topic.type_name):
        raise BadInput(f"{topic.name}: '{topic.type_name}' is not a message type of ROS 2 (PACKAGE/msg/NAME)")
    found = message_class(topic.type_name)
    try:
        if found is None:
            raise LookupError
        if not _is_as_recorded(topic):
            raise BadInput(f"{topic.name}: {topic.type_name} was recorded with another definition than is installed")
    except (LookupError, OSError):
        raise BadInput(f"{topic.name}: message type {topic.type_name} is not installed here") from None
    return found


def qos_of(topic: Topic) -> QoSProfile:
    """The quality of service that a topic was offered with; that of our step topics where none is recorded.

    Raises BadInput where it can't be read.
    """
    text = topic.metadata.get("offered_qos_profiles", "")
    try:
        profiles = from_yaml(text, "offered_qos_profiles")
        if not profiles:
            return copy(STEP_QOS)  # profiles are mutable, and this one is shared
        offered: dict[str, Any] = profiles[0]
        # `ros2 bag` does not know the history of publishers, and records "unknown" with depth 0.
        history = _policy(HistoryPolicy, offered["history"])
        is_known = history in (HistoryPolicy.KEEP_LAST, HistoryPolicy.KEEP_ALL)
        return QoSProfile(
            history=history if is_known else STEP_QOS.history,
            depth=max(int(offered["depth"]), 1) if is_known else STEP_QOS.depth,
            reliability=_policy(ReliabilityPolicy, offered["reliability"]),
            durability=_policy(DurabilityPolicy, offered["durability"]),
            deadline=_duration(offered["deadline"]),
            lifespan=_duration(offered["lifespan"]),
            liveliness=_policy(LivelinessPolicy, offered["liveliness"]),
            liveliness_lease_duration=_duration(offered["liveliness_lease_duration"]),
        )
    except (KeyError, TypeError, ValueError, IndexError, AttributeError, OverflowError) as error:
        reason = error if isinstance(error, BadInput) else repr(error)
        raise BadInput(f"{topic.name}: the recorded quality of service can't be read ({reason})") from None


def _is_as_recorded(topic: Topic) -> bool:
    recorded = topic.metadata.get("topic_type_hash")
    if recorded:
        return recorded == type_hash(topic.type_name, _share)
    return essence(topic.schema) == essence(schema_text(topic.type_name, _share))


def _share(package: str) -> Path:
    return Path(get_package_share_directory(package))


def _policy(kind: Any, value: Any) -> Any:
    """A policy in rosbag2's words (Jazzy) or numbers (before)."""
    return kind(value) if isinstance(value, int) else kind[str(value).upper()]


def _duration(value: dict[str, int]) -> Duration:
    nanoseconds = int(value["sec"]) * 1_000_000_000 + int(value["nsec"])
    # In rclpy 0 is an unspecified duration: infinite.
    return Duration(nanoseconds=0 if nanoseconds >= INFINITE_NS else nanoseconds)


class ReplayViews:
    """Poses and markers for RViz and Foxglove, made of the replayed world states as the simulator makes them.

    The simulator publishes them while somebody subscribes, and they are not recorded: they hold nothing new.

    Args:
        node: publishes them.
        run: topics that it has recorded are left out.
        topics: the replayed ones. Without a topic of world states there are no views.
    """

    def __init__(self, node: Node, run: Run, topics: Collection[str]) -> None:
        worlds = [name for name in topics if run.topics[name].type_name == _WORLD_TYPE and name.endswith(f"/{WORLD}")]
        self._codec = run.codec(_WORLD_TYPE)
        self._world = worlds[0] if worlds else ""
        self._poses: dict[str, Publisher] = {}
        self._markers: Publisher | None = None
        self._wanted: frozenset[Publisher] = frozenset()
        self._looked_s = float("-inf")
        if not worlds:
            return
        place = self._world.removesuffix(WORLD)
        for name in _POSES:
            if place + name not in run.topics:
                self._poses[name] = node.create_publisher(PoseStamped, place + name, POSE_QOS)
        if place + MARKERS not in run.topics:
            self._markers = node.create_publisher(MarkerArray, place + MARKERS, POSE_QOS)

    def show(self, topic: str, data: bytes) -> None:
        """Publishes the views of a message, if it is a world state and somebody subscribes."""
        if topic != self._world or self._codec is None:
            return
        if monotonic() - self._looked_s >= _LOOK_S:
            self._look()
        if not self._wanted:
            return
        try:
            world = self._codec.decode(data)
        except Malformed:
            return  # not a world state: there is nothing to show
        for name, pose in zip(_POSES, pose_msgs(world), strict=True):
            if self._poses.get(name) in self._wanted:
                self._poses[name].publish(pose)
        if self._markers is not None and self._markers in self._wanted:
            self._markers.publish(markers_msg(world))

    def _look(self) -> None:
        self._looked_s = monotonic()
        made = [*self._poses.values(), *([] if self._markers is None else [self._markers])]
        self._wanted = frozenset(publisher for publisher in made if publisher.get_subscription_count())
