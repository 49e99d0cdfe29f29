"""Two nodes of one kind in a graph: two simulators, or two fusion nodes, which both would act on every message.

A node of a kind is known by what it publishes together with the service that it offers, and so under any name. One whose
process was killed stays in the graph for 20 s; it counts no longer.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path
from time import monotonic
from typing import NamedTuple

import rclpy
from rclpy.node import Node
from rclpy.topic_endpoint_info import TopicEndpointInfo

_FAST_DDS = "rmw_fastrtps"
_LOOK_S = 0.1
GRACE_S = 1.0
"""How long a twin that was started later may take to end by itself [s]."""


class _Other(NamedTuple):
    name: str
    started: float
    """When its process was started, in ticks since the machine was; infinity where that is not known."""


class Twins:
    """Looks for other nodes that publish `topic` and offer a service of the type `service`.

    Args:
        own: whether `node` itself is one of them.
    """

    def __init__(self, node: Node, topic: str, service: type, own: bool = True) -> None:
        self._node = node
        self._topic = node.resolve_topic_name(topic)
        module = service.__module__.split(".")
        self._service = f"{module[0]}/srv/{service.__name__}"
        self._own = own
        self._looked_s = self._seen_s = float("-inf")
        self._found = ""

    def found(self) -> str:
        """Names of the nodes that are one too many, or "". One that was started after this node's process, and should end by
        itself, is given GRACE_S."""
        now = monotonic()
        if now - self._looked_s < _LOOK_S:
            return self._found
        self._looked_s = now
        self._found = ""
        # The first look is cheap, and nearly always the only one.
        others = [] if self._node.count_publishers(self._topic) < 2 else list(self._others())
        if not others:
            self._seen_s = float("-inf")
            return ""
        if self._seen_s == float("-inf"):
            self._seen_s = now
        mine = min(_started([os.getpid()]), default=0.0)
        if now - self._seen_s > GRACE_S or (self._own and any(other.started <= mine for other in others)):
            self._found = ", ".join(sorted({f"'{other.name}'" for other in others}))
        return self._found

    @property
    def are_suspected(self) -> bool:
        """Whether the last look saw any, even if they are given time to end."""
        return self._seen_s > float("-inf")

    def _others(self) -> Iterable[_Other]:
        """The living nodes of the kind other than the node itself, or other than the first if it is not of the kind."""
        alike = [each for each in self._node.get_publishers_info_by_topic(self._topic) if self._is_alike(each)]
        me = (self._node.get_name(), self._node.get_namespace())
        if self._own:
            mine = next(
                (each for each in alike if (each.node_name, each.node_namespace) == me and _is_mine(each)), None
            )
            alike = [each for each in alike if each is not mine]
        living = [(each, _started(_processes(each))) for each in alike]
        others = [
            _Other(f"{each.node_namespace.rstrip('/')}/{each.node_name}", min(started))
            for each, started in living
            if started
        ]
        return others if self._own or len(others) > 1 else []

    def _is_alike(self, info: TopicEndpointInfo) -> bool:
        try:
            services = self._node.get_service_names_and_types_by_node(info.node_name, info.node_namespace)
        except RuntimeError:  # the node is not known yet, or any more
            return False
        return any(self._service in types for _, types in services)


def _is_mine(info: TopicEndpointInfo) -> bool:
    return not {0, os.getpid()}.isdisjoint(_processes(info))


def _processes(info: TopicEndpointInfo) -> list[int]:
    """The processes that an endpoint may be of: Fast DDS puts the lower half of the process id into its identifier. 0 stands
    for one that can't be known."""
    if not rclpy.get_rmw_implementation_identifier().startswith(_FAST_DDS):
        return [0]
    low = int.from_bytes(bytes(info.endpoint_gid[4:6]), "little")
    return [
        int(each.name) for each in Path("/proc").iterdir() if each.name.isdigit() and int(each.name) & 0xFFFF == low
    ]


def _started(processes: Iterable[int]) -> list[float]:
    """When each of the processes that live was started."""
    result: list[float] = []
    for process in processes:
        if process == 0:
            result.append(float("inf"))
            continue
        try:
            fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if fields[0] not in "ZX":
            result.append(float(fields[19]))
    return result
