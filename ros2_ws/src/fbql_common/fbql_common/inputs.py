"""A node's input: a subscription that decodes messages, and drops unusable ones with a reason.

Owns what every input needs: counts, throttled warnings, the error for a publisher whose QoS or type does not match, the
age of the last message. Does not own: what a missing input means.
"""

from __future__ import annotations

from collections.abc import Callable
from time import monotonic
from typing import Any

from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import QoSProfile, qos_policy_name_from_kind

from fbql_common.core.text import one_line
from fbql_common.reception import WithReception
from fbql_common.wire import MESSAGES, Rejected, type_name

WARN_PERIOD_S = 1.0
_UNKNOWN_NODE = "_NODE_NAME_UNKNOWN_"
"""The name that rmw gives a publisher whose node is not discovered yet."""


class Input[T]:
    """Subscribes `node` to `topic` and hands (value, bytes) of each sound message to `deliver`.

    Args:
        kind: the domain type, whose message type the topic must carry.
        decode: bytes -> value; raises Rejected (fbql_common.wire) for an unusable message.
    """

    def __init__(
        self,
        node: Node,
        kind: type[T],
        topic: str,
        decode: Callable[[bytes], T],
        deliver: Callable[[T, bytes], None],
        qos: QoSProfile,
    ) -> None:
        self._node = node
        self._decode = decode
        self._deliver = deliver
        self.received = 0
        self.dropped = 0
        self._last_s: float | None = None
        self._warned_s = float("-inf")
        self._warned_unstamped = False
        self._mismatches: set[str] = set()
        self._subscription = node.create_subscription(
            MESSAGES[kind],
            topic,
            self._callback(),
            qos,
            raw=True,
            event_callbacks=SubscriptionEventCallbacks(incompatible_qos=self._on_incompatible_qos),
        )
        self.topic = self._subscription.topic_name
        self._type_name = type_name(kind)

    def _callback(self) -> Callable[..., None]:
        return self._on_bytes

    def _on_bytes(self, data: bytes) -> None:
        try:
            value = self._decode(data)
        except Rejected as reason:
            self.drop(str(reason))
            return
        self.received += 1
        self._last_s = monotonic()
        if getattr(value, "stamp_ns", None) == 0 and not self._warned_unstamped:
            self._warned_unstamped = True
            self._node.get_logger().warning(f"{self.topic}: a message has no stamp (reported once)")
        self._deliver(value, data)

    def drop(self, reason: str) -> None:
        """Counts a dropped message, and warns at most once a second."""
        self.dropped += 1
        now = monotonic()
        if now - self._warned_s >= WARN_PERIOD_S:
            self._warned_s = now
            self._node.get_logger().warning(
                one_line(f"dropped a message on {self.topic}: {reason} ({self.dropped} dropped so far)")
            )

    def age_s(self) -> float | None:
        """Time since the last sound message [s], on the steady clock; None before the first."""
        return None if self._last_s is None else monotonic() - self._last_s

    def publishers(self) -> int:
        """The number of matching publishers."""
        return self._subscription.get_publisher_count()

    def check_types(self) -> None:
        """Logs an error, once, for each other message type published on this topic: DDS ignores it silently."""
        for info in self._node.get_publishers_info_by_topic(self.topic):
            if info.topic_type != self._type_name:
                who = "somebody" if info.node_name == _UNKNOWN_NODE else f"node '{info.node_name}'"
                self._mismatch(
                    info.topic_type,
                    f"{self.topic}: {who} publishes {info.topic_type}, expected {self._type_name}; "
                    "its messages will not arrive",
                )

    def _on_incompatible_qos(self, event: Any) -> None:
        policy = qos_policy_name_from_kind(event.last_policy_kind)
        self._mismatch(
            policy, f"{self.topic}: a publisher's QoS is incompatible in {policy}; its messages will not arrive"
        )

    def _mismatch(self, what: str, text: str) -> None:
        if what not in self._mismatches:
            self._mismatches.add(what)
            self._node.get_logger().error(one_line(text))


class TimedInput[T](Input[T]):
    """The same for messages whose age counts: `deliver` also gets when the middleware received the message, by the system clock [ns];
    0: unknown. See `reception.AgeClock`."""

    def __init__(
        self,
        node: Node,
        kind: type[T],
        topic: str,
        decode: Callable[[bytes], T],
        deliver: Callable[[T, bytes, int], None],
        qos: QoSProfile,
    ) -> None:
        self._received_ns = 0
        super().__init__(node, kind, topic, decode, lambda value, data: deliver(value, data, self._received_ns), qos)

    def _callback(self) -> Callable[..., None]:
        return WithReception(self._on_timed)

    def _on_timed(self, data: bytes, received_ns: int) -> None:
        self._received_ns = received_ns
        self._on_bytes(data)
