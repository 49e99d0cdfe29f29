"""Nodes of one process, spun by hand, and partner nodes that a test controls.

No test sleeps: `Bench.until` spins until a condition holds, for a bounded time, and fails with what it waited for.
"""

from __future__ import annotations

import contextlib
import itertools
from collections.abc import Callable, Mapping
from pathlib import Path
from time import monotonic
from typing import Any

import pytest
import rclpy
from ament_index_python.packages import get_package_share_directory
from fbql_common.core.topic_names import RESET_EPISODE, WHEEL_COMMAND, WORLD, behavior_topic
from fbql_common.core.types import BehaviorOutput, Decision, WheelCommand, World
from fbql_common.qos import STEP_QOS
from fbql_common.spin import GraphNode
from fbql_common.wire import (
    MESSAGES,
    Rejected,
    decode_command,
    decode_decision,
    decode_output,
    decode_world,
    encode_output,
    encode_world,
)
from fbql_msgs.srv import ResetEpisode
from patience import PATIENCE_S
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions

BEHAVIORS = ("ball_seeking", "wall_avoiding", "approaching")
DECODE = {World: decode_world, BehaviorOutput: decode_output, WheelCommand: decode_command, Decision: decode_decision}
STEP_NS = 16_666_667
SMALL = {"start_parameter_services": False, "enable_rosout": False}
"""Of partners nobody asks for parameters: a node without these services is made in a fifth of the time."""
HASHES = ("aa" * 32, "bb" * 32, "cc" * 32)


def world_at(episode: int, step: int, stamp_ns: int | None = None, **fields: Any) -> World:
    """A world state in which the robot stands clear of everything and faces the ball."""
    stamp_ns = (step + 1) * STEP_NS if stamp_ns is None else stamp_ns
    pose = (-0.5, 0.0, 0.0, 0.0, 0.0, 0.5, 0.1, 0.0, 0.0, -0.5, 0.9, -1.5)
    return World(stamp_ns, episode, step, *pose, *[False] * 6)._replace(**fields)


def output_to(world: World, index: int, **fields: Any) -> BehaviorOutput:
    """The answer of behavior `index`, in leaf `index`, to a world state."""
    left, right = 10.0 * (index + 1), -2.0 * (index + 1)
    return BehaviorOutput(
        *world[:3], BEHAVIORS[index], left, right, index, 5, HASHES[index], False, (0.5, 0.25)
    )._replace(**fields)


def shipped_tree(behavior: str) -> Path:
    """The tree file that ships for a behavior."""
    return Path(get_package_share_directory("fbql_behaviors")) / "trees" / f"{behavior}.json"


class Participant:
    """A context in a domain."""

    def __init__(self, environment: Mapping[str, str]) -> None:
        self.context = rclpy.Context()
        with pytest.MonkeyPatch.context() as patch:
            for name, value in environment.items():
                patch.setenv(name, value)
            rclpy.init(args=[], context=self.context, signal_handler_options=SignalHandlerOptions.NO)
            # The middleware reads the environment when the first node is made.
            self._anchor = Node("anchor", context=self.context, use_global_arguments=False, enable_rosout=False)

    def close(self) -> None:
        self._anchor.destroy_node()
        self.context.try_shutdown()


class Bench:
    """One test's nodes, in a namespace of their own, spun by hand."""

    _numbers = itertools.count()

    def __init__(self, participant: Participant, capfd: pytest.CaptureFixture[str]) -> None:
        self.namespace = f"/bench{next(self._numbers)}"
        self.log = ""
        self._context = participant.context
        # One per test, so that no event of an earlier test is left in it.
        self._executor = EventsExecutor(context=self._context)
        self._capfd = capfd
        self._nodes: list[Node] = []

    def add(self, make: Callable[..., Any], *arguments: Any, **parameters: Any) -> Any:
        """Makes a node with these parameters, and spins it from now on."""
        overrides = [Parameter(name, value=value) for name, value in parameters.items()]
        node = make(
            *arguments,
            context=self._context,
            namespace=self.namespace,
            use_global_arguments=False,
            parameter_overrides=overrides,
        )
        self._executor.add_node(node)
        self._nodes.append(node)
        return node

    def remove(self, node: Node) -> None:
        """Ends a node as its process would."""
        if isinstance(node, GraphNode):
            node.close()
        self._nodes.remove(node)
        self._executor.remove_node(node)
        for _ in range(20):
            self._executor.spin_once(timeout_sec=0)  # events that are queued for it
        node.destroy_node()

    def until(self, is_so: Callable[[], Any], what: str, timeout_s: float = PATIENCE_S) -> None:
        """Spins until `is_so()` is true; fails after `timeout_s`."""
        deadline = monotonic() + timeout_s
        while not is_so():
            if monotonic() > deadline:
                pytest.fail(f"waited {timeout_s:g} s for {what}; log:\n{self.said()}")
            self.spin()

    def spin(self) -> None:
        """Spins for a moment."""
        self._executor.spin_once(timeout_sec=0.02)

    def until_said(self, text: str, times: int = 1) -> None:
        """Spins until the nodes have logged a text `times` times."""
        self.until(lambda: self.said().count(text) >= times, f"the log to say '{text}'")

    def said(self) -> str:
        """Everything logged so far."""
        self.log += self._capfd.readouterr().err
        return self.log

    def call(self, node: Node, kind: type[Any], service: str, **fields: Any) -> Any:
        """Calls a service and returns its answer."""
        client = node.create_client(kind, service)
        self.until(client.service_is_ready, f"service {service}")
        answer = client.call_async(kind.Request(**fields))
        self.until(answer.done, f"an answer of {service}")
        return answer.result()

    def close(self) -> None:
        for node in list(self._nodes):
            self.remove(node)
        self._executor.shutdown()


class Heard(list[Any]):
    """The values received on a topic, and their bytes in `data`."""

    def __init__(self) -> None:
        super().__init__()
        self.data: list[bytes] = []


def listen(node: Node, kind: type[Any], topic: str) -> Heard:
    """Collects the messages of a topic, in order."""
    heard = Heard()

    def keep(data: bytes) -> None:
        with contextlib.suppress(Rejected):
            heard.append(DECODE[kind](data))
            heard.data.append(data)

    node.create_subscription(MESSAGES[kind], topic, keep, STEP_QOS, raw=True)
    return heard


class Partner(Node):
    """A node of the test."""

    def __init__(self, name: str = "partner", **options: Any) -> None:
        super().__init__(name, **SMALL, **options)


class FakeSimulator(Node):
    """Publishes world states on request, grants episodes, collects commands.

    A granted episode begins at once with a world state of step 0, unless `loses_first`. `stamp_ns` is the last stamp.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__("simulator", **SMALL, **options)
        self.commands = listen(self, WheelCommand, WHEEL_COMMAND)
        self.granted: list[tuple[int, int]] = []
        self.refusal = ""
        self.loses_first = False
        self.stamp_ns = 0
        self.publisher = self.create_publisher(MESSAGES[World], WORLD, STEP_QOS)
        self.create_service(ResetEpisode, RESET_EPISODE, self._on_reset)

    def _on_reset(self, request: ResetEpisode.Request, response: ResetEpisode.Response) -> ResetEpisode.Response:
        response.success, response.message = not self.refusal, self.refusal
        if not self.refusal:
            self.granted.append((request.episode, request.seed))
            if not self.loses_first:
                self.show(request.episode, 0)
        return response

    def show(self, episode: int, step: int, **fields: Any) -> World:
        """Publishes the next world state."""
        self.stamp_ns += STEP_NS
        return self.show_again(world_at(episode, step, self.stamp_ns, **fields))

    def show_again(self, world: World) -> World:
        """Publishes a given world state."""
        self.publisher.publish(encode_world(world))
        return world


class FakeBehavior(Node):
    """Answers every valid world state, unless `silent`; collects them, and its answers once they have arrived."""

    def __init__(self, index: int, **options: Any) -> None:
        super().__init__(BEHAVIORS[index], **SMALL, **options)
        self.index = index
        self.silent = False
        self.fields: dict[str, Any] = {}
        self.worlds: list[World] = []
        topic = behavior_topic(BEHAVIORS[index])
        self.publisher = self.create_publisher(MESSAGES[BehaviorOutput], topic, STEP_QOS)
        self.answered = listen(self, BehaviorOutput, topic)
        self.create_subscription(MESSAGES[World], WORLD, self._on_world, STEP_QOS, raw=True)

    def _on_world(self, data: bytes) -> None:
        try:
            world = decode_world(data)
        except Rejected:
            return
        self.worlds.append(world)
        if not self.silent:
            self.answer(world)

    def answer(self, world: World) -> None:
        """Publishes the answer to a world state."""
        self.publisher.publish(encode_output(output_to(world, self.index, **self.fields)))
