"""The node of a tree for any robot: the topics of its recipe in, velocity commands out.

Owns: one tree, the rate of its commands. Does not own: who else drives the robot (a mux decides). Subscribes the topics that
the recipe in the tree file names; publishes `cmd_vel`, a Twist or, with `stamped`, a TwistStamped. While an observation is
missing, older than the recipe allows or not finite, it publishes nothing. Parameters: `TwistBehaviorParameters`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from time import monotonic, monotonic_ns
from typing import Any

from fbql_common.core.errors import BadInput
from fbql_common.core.parameters import parameter
from fbql_common.core.text import one_line
from fbql_common.core.topic_names import CMD_VEL
from fbql_common.core.twist import StampedTwist, Twist
from fbql_common.declare import declare_parameters
from fbql_common.message_types import message_class
from fbql_common.qos import COMMAND_QOS
from fbql_common.spin import GraphNode, spin
from fbql_common.watch import steady_timer
from fbql_common.wire import MESSAGES, encode_stamped_twist, encode_twist
from rclpy.qos import qos_profile_sensor_data

from fbql_behaviors.core.twist_behavior import TwistBehavior
from fbql_behaviors.storage import load_tree

_SAY_PERIOD_S = 5.0
"""Shortest time between two lines of the log about the same state."""


@dataclass(frozen=True)
class TwistBehaviorParameters:
    """Parameters of the node of a tree from a bag."""

    tree_file: str = parameter("", "tree file to run, made by induce --bag", required=True)
    rate_hz: float = parameter(
        10.0,
        "how often a command is published; 0: with each message of the last topic in the recipe",
        unit="Hz",
        low=0.0,
        high=1000.0,
    )
    stamped: bool = parameter(False, "publish TwistStamped instead of Twist")
    frame: str = parameter("base_link", "frame of the header of a TwistStamped")


PARAMETERS = (TwistBehaviorParameters,)


class TwistBehaviorNode(GraphNode):
    """A tree of any robot as a source of velocity commands."""

    def __init__(self, **options: Any) -> None:
        super().__init__("twist_behavior", **options)
        parameters = declare_parameters(self, TwistBehaviorParameters)
        path = Path(parameters.tree_file)
        tree = load_tree(path)
        self._behavior = TwistBehavior(tree)
        self._stamped, self._frame = parameters.stamped, parameters.frame
        self._has_sim_time = self.get_clock().ros_time_is_active
        self._problem: str | None = None
        self._said_s: dict[str, float] = {}
        self._publisher = self.create_publisher(
            MESSAGES[StampedTwist if self._stamped else Twist], CMD_VEL, COMMAND_QOS
        )
        self._inputs = [
            self.create_subscription(
                _class_of(type_name), topic, partial(self._on_message, topic), qos_profile_sensor_data
            )
            for topic, type_name in self._behavior.types.items()
        ]
        self._paced_by = "" if parameters.rate_hz else list(self._behavior.types)[-1]
        """The topic with whose messages commands are published; empty: a timer sets the pace."""
        if parameters.rate_hz:
            self._timer = steady_timer(self, 1.0 / parameters.rate_hz, self._drive)
        topics = ", ".join(each.topic_name for each in self._inputs)
        self.get_logger().info(
            one_line(
                f"{tree.behavior}: {tree.leaf_count} leaves, tree {tree.hash[:12]}, from {path.name}; senses {topics}"
            )
        )

    def _now_ns(self) -> int:
        """The time by which ages are measured: simulated time, or the steady clock, which is never set."""
        return self.get_clock().now().nanoseconds if self._has_sim_time else monotonic_ns()

    def _on_message(self, topic: str, message: Any) -> None:
        try:
            self._behavior.hear(topic, message, self._now_ns())
        except BadInput as error:
            self._warn(f"dropped a message: {error}")
        if topic == self._paced_by:
            self._drive()

    def _drive(self) -> None:
        answer = self._behavior.answer(self._now_ns())
        if answer.problem != self._problem:
            self._problem = answer.problem
            if answer.problem:
                self._warn(f"publishes no command: {answer.problem}")
            else:
                self.get_logger().info("publishes commands")
        if answer.twist is None:
            return
        if self._stamped:
            stamped = StampedTwist(self.get_clock().now().nanoseconds, self._frame, answer.twist)
            self._publisher.publish(encode_stamped_twist(stamped))
        else:
            self._publisher.publish(encode_twist(answer.twist))

    def _warn(self, text: str) -> None:
        """Logs a warning, each at most once in a while."""
        now_s = monotonic()
        if now_s - self._said_s.get(text, -_SAY_PERIOD_S) >= _SAY_PERIOD_S:
            self._said_s[text] = now_s
            self.get_logger().warning(one_line(text))

    def close(self) -> None:
        if self._behavior.clamped_count:
            self.get_logger().info(
                f"{self._behavior.clamped_count} observations lay outside the tree's root region and were clamped"
            )


def _class_of(type_name: str) -> type[Any]:
    """The class of a message type. Raises BadInput when it is not installed."""
    found = message_class(type_name)
    if found is None:
        raise BadInput(f"the tree senses messages of type {type_name}, which is not installed here")
    return found


def twist_behavior() -> int:
    """Runs a tree made from a bag: `--ros-args -p tree_file:=FILE`."""
    return spin([TwistBehaviorNode])
