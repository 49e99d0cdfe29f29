"""The launcher's own look at the graph: which nodes and topics are there, and how the match stands."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from time import monotonic
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from fbql_common.topics import DECISION, DIAGNOSTICS, POSE_QOS, WHEEL_COMMAND, WORLD, behavior_topic
from rclpy.experimental import EventsExecutor
from rclpy.qos import QoSProfile
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future

_STATUS = "fusion: match"


class Observer:
    """A node of the launcher. It only looks; nothing depends on it."""

    def __init__(self, domain_id: int) -> None:
        self._context = rclpy.Context()
        args = ["--ros-args", "--disable-external-lib-logs"]
        rclpy.init(
            args=args, context=self._context, domain_id=domain_id, signal_handler_options=SignalHandlerOptions.NO
        )
        self._node = rclpy.create_node("bringup", context=self._context, use_global_arguments=False)
        self._executor = EventsExecutor(context=self._context)
        self._executor.add_node(self._node)
        self.status: dict[str, str] = {}
        self._node.create_subscription(DiagnosticArray, DIAGNOSTICS, self._on_diagnostics, POSE_QOS)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if status.name == _STATUS:
                self.status = {pair.key: pair.value for pair in status.values}

    def hear(self, kind: type[Any], topic: str, qos: QoSProfile, heard: Callable[[bytes], None]) -> None:
        """Hands on every message of a topic, as the bytes that were on the wire, whenever it looks."""
        self._node.create_subscription(kind, topic, heard, qos, raw=True)

    def look(self, duration_s: float) -> None:
        """Takes in what comes for this long."""
        deadline = monotonic() + duration_s
        while (left_s := deadline - monotonic()) > 0:
            # A future of its own: the executor leaves a callback in it each time.
            self._executor.spin_until_future_complete(Future(), timeout_sec=left_s)

    def nodes(self) -> list[str]:
        """Names of the other nodes in the domain that have no namespace, as ours have none."""
        return [
            name
            for name, namespace in self._node.get_node_names_and_namespaces()
            if namespace == "/" and name != self._node.get_name()
        ]

    def missing(self, nodes: Sequence[str], behaviors: Sequence[str]) -> list[str]:
        """What the graph still lacks, in words."""
        present = self.nodes()
        lacks = [f"node '{name}'" for name in nodes if name not in present]
        topics = (WORLD, *(behavior_topic(name) for name in behaviors), WHEEL_COMMAND, DECISION)
        lacks += [f"a publisher on '/{topic}'" for topic in topics if self._node.count_publishers(topic) == 0]
        return lacks

    def close(self) -> None:
        """Leaves the graph."""
        self._node.destroy_node()
        self._context.try_shutdown()
