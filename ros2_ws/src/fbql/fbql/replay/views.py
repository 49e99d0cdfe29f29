"""What RViz and Foxglove look at, for a recording that has none of it: poses and markers, made of the world states.

The simulator makes them while somebody looks, and they are not recorded: they tell nothing that a world state does not.
Here they are made in the same way.
"""

from __future__ import annotations

from collections.abc import Collection
from time import monotonic

from fbql_common.core.cdr import Malformed
from fbql_common.topics import BALL_POSE, POSE_QOS, ROBOT_POSE, WALL_POSE, WORLD
from fbql_recording import Run
from fbql_sim.views import markers_msg, pose_msgs
from geometry_msgs.msg import PoseStamped
from rclpy.node import Node
from rclpy.publisher import Publisher
from visualization_msgs.msg import MarkerArray

MARKERS = "simulator/markers"
_TYPE = "fbql_msgs/msg/WorldState"
_POSES = (ROBOT_POSE, BALL_POSE, WALL_POSE)
_LOOK_S = 0.25
"""How often is looked who subscribes [s]."""


class ReplayViews:
    """The views of the world states that are replayed.

    Args:
        node: publishes them.
        run: what is recorded is not made again.
        topics: that are replayed. Without a topic of world states among them there are no views.
    """

    def __init__(self, node: Node, run: Run, topics: Collection[str]) -> None:
        worlds = [name for name in topics if run.topics[name].type_name == _TYPE and name.endswith(f"/{WORLD}")]
        self._codec = run.codec(_TYPE)
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
        """Publishes the views of a message that was just published, if it is a world state and somebody looks."""
        if topic != self._world or self._codec is None:
            return
        if monotonic() - self._looked_s >= _LOOK_S:
            self._look()
        if not self._wanted:
            return
        try:
            world = self._codec.decode(data)
        except Malformed:
            return  # no world state: there is nothing to be seen
        for name, pose in zip(_POSES, pose_msgs(world), strict=True):
            if self._poses.get(name) in self._wanted:
                self._poses[name].publish(pose)
        if self._markers is not None and self._markers in self._wanted:
            self._markers.publish(markers_msg(world))

    def _look(self) -> None:
        self._looked_s = monotonic()
        made = [*self._poses.values(), *([] if self._markers is None else [self._markers])]
        self._wanted = frozenset(publisher for publisher in made if publisher.get_subscription_count())
