"""The commands' own nodes in a graph, such as the one that watches a bring-up."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from time import monotonic
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from fbql_common.core.topic_names import DECISION, DIAGNOSTICS, WHEEL_COMMAND, WORLD, behavior_topic
from fbql_common.qos import POSE_QOS
from rclpy.experimental import EventsExecutor
from rclpy.qos import QoSProfile
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future

from fbql.cli.interrupts import Interrupts

_STATUS = "fusion: match"
_WORLD_STATUS = "simulator: world"

DISCOVERY_S = 4.5
"""How long what is already in a domain may stay unseen by a node that joins it [s]: participants announce themselves
every 3 s, and a busy machine is late."""
_LOOK_S = 0.05
"""How long to receive messages between two looks [s]."""


class CommandNode:
    """A node with its own context, which receives messages only in `look`."""

    def __init__(self, name: str, domain_id: int) -> None:
        self.domain_id = domain_id
        self._context = rclpy.Context()
        args = ["--ros-args", "--disable-external-lib-logs"]
        rclpy.init(
            args=args, context=self._context, domain_id=domain_id, signal_handler_options=SignalHandlerOptions.NO
        )
        self.node = rclpy.create_node(name, context=self._context, use_global_arguments=False)
        self._executor = EventsExecutor(context=self._context)
        self._executor.add_node(self.node)

    def look(self, duration_s: float) -> None:
        """Receives messages for this long."""
        deadline = monotonic() + duration_s
        while (left_s := deadline - monotonic()) > 0:
            # A new future each time: the executor leaves a callback in it.
            self._executor.spin_until_future_complete(Future(), timeout_sec=left_s)

    def discover[T](self, seen: Callable[[], T], interrupts: Interrupts) -> T:
        """What `seen` returns, once that is true, or else after `DISCOVERY_S`, or when a signal comes."""
        deadline = monotonic() + DISCOVERY_S
        while True:
            self.look(_LOOK_S)
            found = seen()
            if found or interrupts.came or monotonic() > deadline:
                return found

    def close(self) -> None:
        """Leaves the graph."""
        self._executor.shutdown()  # else its sockets stay open, and the domain counts as used
        self.node.destroy_node()
        self._context.try_shutdown()


class Observer(CommandNode):
    """Watches a bring-up: which nodes and topics are there, and how the match stands. Nothing depends on it."""

    def __init__(self, domain_id: int) -> None:
        super().__init__("bringup", domain_id)
        self.status: dict[str, str] = {}
        self.missed_ticks: int | None = None
        """Steps that the simulator could not do in time, so far; None: it has not been heard."""
        self.node.create_subscription(DiagnosticArray, DIAGNOSTICS, self._on_diagnostics, POSE_QOS)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if status.name == _STATUS:
                self.status = {pair.key: pair.value for pair in status.values}
            elif status.name == _WORLD_STATUS:
                self.missed_ticks = next((int(pair.value) for pair in status.values if pair.key == "missed_ticks"), 0)

    def hear(self, kind: type[Any], topic: str, qos: QoSProfile, heard: Callable[[bytes], None]) -> None:
        """Passes on every message of a topic, as the bytes that were on the wire."""
        self.node.create_subscription(kind, topic, heard, qos, raw=True)

    def nodes(self) -> list[str]:
        """Names of the other nodes in the domain that have no namespace, as ours have none."""
        return [
            name
            for name, namespace in self.node.get_node_names_and_namespaces()
            if namespace == "/" and name != self.node.get_name()
        ]

    def missing(self, nodes: Sequence[str], behaviors: Sequence[str]) -> list[str]:
        """What the graph still lacks, in words."""
        present = self.nodes()
        lacks = [f"node '{name}'" for name in nodes if name not in present]
        topics = (WORLD, *(behavior_topic(name) for name in behaviors), WHEEL_COMMAND, DECISION)
        lacks += [f"a publisher on '/{topic}'" for topic in topics if self.node.count_publishers(topic) == 0]
        return lacks
