"""A mux with sources and locks that a test plays, and everything that it puts out."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from fbql_common.core.topic_names import MUX_OUTPUT
from fbql_common.core.twist import StampedTwist, Twist
from fbql_common.qos import COMMAND_QOS, LATCHED_QOS, STEP_QOS
from fbql_common.wire import (
    MESSAGES,
    decode_stamped_twist,
    decode_twist,
    encode_flag,
    encode_stamped_twist,
    encode_twist,
)
from fbql_fusion.twist_mux_node import TwistMuxNode
from hand_driven import Bench, Partner
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile
from std_msgs.msg import String

TWO_SOURCES = """
/**/twist_mux:
  ros__parameters:
    topics:
      navigation:
        topic   : nav_vel
        timeout : 0.5
        priority: 10
      joystick:
        topic   : joy_vel
        timeout : 0.5
        priority: 100
    locks:
      pause:
        topic   : pause_navigation
        timeout : 0.0
        priority: 50
"""
"""A file as it is written for twist_mux."""


def encode(command: Twist | StampedTwist) -> bytes:
    """The message of a command."""
    return encode_stamped_twist(command) if isinstance(command, StampedTwist) else encode_twist(command)


class Sources:
    """A node that publishes what the sources and locks of a mux do, and hears its output."""

    def __init__(self, bench: Bench, stamped_output: bool = False) -> None:
        self.bench = bench
        self.partner = bench.add(Partner)
        self.out: list[Twist | StampedTwist] = []
        self.bytes: list[bytes] = []
        self.drivers: list[str] = []
        self._publishers: dict[str, Publisher] = {}
        self._decode: Callable[[bytes], Any] = decode_stamped_twist if stamped_output else decode_twist
        kind = MESSAGES[StampedTwist if stamped_output else Twist]
        everything = QoSProfile(depth=1000)
        self.partner.create_subscription(kind, MUX_OUTPUT, self._on_output, everything, raw=True)
        self.partner.create_subscription(
            String, "twist_mux/driver", lambda text: self.drivers.append(text.data), LATCHED_QOS
        )

    def _on_output(self, data: bytes) -> None:
        self.out.append(self._decode(data))
        self.bytes.append(data)

    def publisher(self, topic: str, kind: type[Any]) -> Publisher:
        """The publisher of a topic, which the mux hears."""
        if topic not in self._publishers:
            made = self.partner.create_publisher(MESSAGES[kind], topic, COMMAND_QOS if kind is not bool else STEP_QOS)
            self.bench.until(lambda: made.get_subscription_count() > 0, f"the mux to subscribe {topic}")
            self._publishers[topic] = made
        return self._publishers[topic]

    def send(self, topic: str, command: Twist | StampedTwist) -> None:
        """Publishes a command."""
        self.publisher(topic, type(command)).publish(encode(command))

    def lock(self, topic: str, on: bool) -> None:
        """Publishes the state of a lock."""
        self.publisher(topic, bool).publish(encode_flag(on))


class OwnMux(Sources):
    """The same with a mux in this process, made with a file of parameters."""

    def __init__(
        self, bench: Bench, place: Path, text: str = TWO_SOURCES, *arguments: str, stamped: bool = False
    ) -> None:
        file = place / "twist_mux.yaml"
        file.write_text(text)
        words = ["--ros-args", "--params-file", str(file), *arguments]
        self.node = bench.add(lambda **options: TwistMuxNode(cli_args=words, **options))
        super().__init__(bench, stamped)
        bench.until(lambda: self.partner.count_publishers(MUX_OUTPUT) == 1, "the output")
        bench.until(lambda: self.drivers, "the first word about who drives")

    def publisher(self, topic: str, kind: type[Any]) -> Publisher:
        made = super().publisher(topic, kind)
        inputs = [each for each in (*self.node._sources, *self.node._locks) if each.topic == made.topic_name]
        # Until the mux knows the publisher too: it would miss a message before that.
        self.bench.until(
            lambda: all(each.publishers() > 0 for each in inputs), f"the mux to find who publishes {topic}"
        )
        return made

    def received(self) -> int:
        """How many messages of sources and locks the mux has taken or dropped."""
        return sum(each.received + each.dropped for each in (*self.node._sources, *self.node._locks))

    def send(self, topic: str, command: Twist | StampedTwist) -> None:
        """Publishes a command and waits until the mux has it."""
        before = self.received()
        super().send(topic, command)
        self.bench.until(lambda: self.received() > before, f"the mux to receive a command on {topic}")

    def lock(self, topic: str, on: bool) -> None:
        """Publishes the state of a lock and waits until the mux has it."""
        before = self.received()
        super().lock(topic, on)
        self.bench.until(lambda: self.received() > before, f"the mux to receive a lock on {topic}")
