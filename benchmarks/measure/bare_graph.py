"""The five nodes of the graph without any work: empty messages of the same types go round, one after the other.

The baseline of benchmarks/lockstep.py. It passes rclpy's message objects, or with `raw` prepared bytes that are never
decoded. To run it alone: python bare_graph.py ROLE... --ros-args -p steps:=20000 -p raw:=false (inside the environment)
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from time import perf_counter
from typing import Any

from fbql_common.core.parameters import parameter
from fbql_common.core.topic_names import DECISION, WHEEL_COMMAND, WORLD, behavior_topic
from fbql_common.declare import declare_parameters
from fbql_common.qos import STEP_QOS
from fbql_common.spin import GraphNode, spin
from fbql_common.watch import steady_timer
from fbql_msgs.msg import BehaviorOutput, FusionDecision, WheelCommand, WorldState
from rclpy.serialization import serialize_message

BEHAVIORS = ("ball_seeking", "wall_avoiding", "approaching")


@dataclass(frozen=True)
class BareParameters:
    """Parameters of the bare graph."""

    steps: int = parameter(20000, "steps to go round", low=1)
    raw: bool = parameter(False, "pass bytes instead of messages")


class BareNode(GraphNode):
    """A node that publishes empty messages."""

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self.parameters = declare_parameters(self, BareParameters)

    def output(self, kind: Any, topic: str) -> Callable[[], None]:
        """A function that publishes an empty message."""
        publisher = self.create_publisher(kind, topic, STEP_QOS)
        message = serialize_message(kind()) if self.parameters.raw else kind()
        return partial(publisher.publish, message)

    def input(self, kind: Any, topic: str, callback: Callable[[Any], None]) -> Any:
        """A subscription."""
        return self.create_subscription(kind, topic, callback, STEP_QOS, raw=self.parameters.raw)


class BareSimulator(BareNode):
    """Publishes the next world state when a command arrives; prints the steps per second."""

    def __init__(self) -> None:
        super().__init__("simulator")
        self._publish = self.output(WorldState, WORLD)
        self._subscription = self.input(WheelCommand, WHEEL_COMMAND, self._on_command)
        self._steps = 0
        self._begun_s = 0.0
        self._start = steady_timer(self, 0.2, self._begin)

    def _begin(self) -> None:
        """Publishes the first world state again until the first command arrives."""
        if self._steps == 0:
            self._publish()

    def _on_command(self, _message: Any) -> None:
        if self._steps == 0:
            self._begun_s = perf_counter()
        if self._steps == self.parameters.steps:
            print(json.dumps({"steps_per_s": self._steps / (perf_counter() - self._begun_s)}), flush=True)
            self.finish()
            return
        self._steps += 1
        self._publish()


class BareBehavior(BareNode):
    """Answers every world state."""

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self._publish = self.output(BehaviorOutput, behavior_topic(name))
        self._subscription = self.input(WorldState, WORLD, lambda _message: self._publish())


class BareFusion(BareNode):
    """Publishes command and decision when the world state and every answer to it have arrived."""

    def __init__(self) -> None:
        super().__init__("fusion")
        self._publish_command = self.output(WheelCommand, WHEEL_COMMAND)
        self._publish_decision = self.output(FusionDecision, DECISION)
        self._heard = [0] * (len(BEHAVIORS) + 1)
        inputs = [(WorldState, WORLD), *((BehaviorOutput, behavior_topic(name)) for name in BEHAVIORS)]
        self._subscriptions = [
            self.input(kind, topic, partial(self._on_message, index)) for index, (kind, topic) in enumerate(inputs)
        ]

    def _on_message(self, index: int, _message: Any) -> None:
        self._heard[index] = 1
        if sum(self._heard) == len(self._heard):
            self._heard = [0] * len(self._heard)
            self._publish_command()
            self._publish_decision()


ROLES: dict[str, Callable[[], BareNode]] = {
    "simulator": BareSimulator,
    **{name: partial(BareBehavior, name) for name in BEHAVIORS},
    "fusion": BareFusion,
}

if __name__ == "__main__":
    split = sys.argv.index("--ros-args") if "--ros-args" in sys.argv else len(sys.argv)
    sys.exit(spin([ROLES[role] for role in sys.argv[1:split]], [sys.argv[0], *sys.argv[split:]]))
