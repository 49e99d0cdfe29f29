"""The graph live in Foxglove: the messages of its topics, byte for byte, on a websocket of this machine.

It needs foxglove-sdk, the extra `foxglove`. Nothing in the graph depends on it: a client that is slow or gone loses
messages, but delays nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

from ament_index_python.packages import get_package_share_directory
from diagnostic_msgs.msg import DiagnosticArray
from fbql_common.checkout import how_to_install
from fbql_common.core.errors import BadInput
from fbql_common.core.topic_names import (
    BALL_POSE,
    CLOCK,
    DECISION,
    DIAGNOSTICS,
    ROBOT_POSE,
    WALL_POSE,
    WHEEL_COMMAND,
    WORLD,
    behavior_topic,
)
from fbql_common.core.types import BehaviorOutput, Decision, WheelCommand, World
from fbql_common.qos import STEP_QOS
from fbql_common.wire import MESSAGES
from fbql_recording.message_definitions import schema_text
from geometry_msgs.msg import PoseStamped
from rosgraph_msgs.msg import Clock
from visualization_msgs.msg import MarkerArray

from fbql.graph.observer import Observer

HOST = "127.0.0.1"
MARKERS = "simulator/markers"
PACKAGE = "foxglove"


class FoxgloveLive:
    """A websocket server of the Foxglove protocol, for the topics of one graph.

    Args:
        port: of this machine; 0: a free one.

    Raises:
        BadInput: foxglove-sdk is not installed, or the port is taken.
    """

    def __init__(self, port: int) -> None:
        try:
            self._sdk: Any = import_module(PACKAGE)
        except ImportError:
            raise BadInput(
                f"--foxglove needs foxglove-sdk, which is not installed: {how_to_install('foxglove')}"
            ) from None
        if not 0 <= port <= 65535:
            raise BadInput(f"--foxglove {port}: a port is a number from 0 to 65535")
        self._context = self._sdk.Context()
        try:
            self._server = self._sdk.start_server(name="FBQL", host=HOST, port=port, context=self._context)
        except RuntimeError as error:
            raise BadInput(f"--foxglove {port}: can't serve there ({error}); name another port, or 0") from None

    @property
    def address(self) -> str:
        """Where Foxglove connects to."""
        return f"ws://{HOST}:{self._server.port}"

    def attach(self, observer: Observer, behaviors: Sequence[str]) -> None:
        """From now on serves what the observer receives."""
        for topic, kind in topics_of(behaviors).items():
            observer.hear(kind, topic, STEP_QOS, self._channel(topic, kind))

    def _channel(self, topic: str, kind: type[Any]) -> Callable[[bytes], None]:
        """The function that sends a message of a topic to its subscribers."""
        package = kind.__module__.partition(".")[0]
        name = f"{package}/msg/{kind.__name__}"
        text = schema_text(name, lambda each: Path(get_package_share_directory(each)))
        schema = self._sdk.Schema(name=name, encoding="ros2msg", data=text.encode())
        absolute = topic if topic.startswith("/") else f"/{topic}"
        channel = self._sdk.Channel(absolute, message_encoding="cdr", schema=schema, context=self._context)
        return channel.log


def topics_of(behaviors: Sequence[str]) -> dict[str, type[Any]]:
    """Every topic of a graph that a person may want to see, with its message class."""
    outputs = {behavior_topic(name): MESSAGES[BehaviorOutput] for name in behaviors}
    steps = {WORLD: MESSAGES[World], **outputs, WHEEL_COMMAND: MESSAGES[WheelCommand], DECISION: MESSAGES[Decision]}
    poses = dict.fromkeys((ROBOT_POSE, BALL_POSE, WALL_POSE), PoseStamped)
    return {**steps, **poses, MARKERS: MarkerArray, CLOCK: Clock, DIAGNOSTICS: DiagnosticArray}
