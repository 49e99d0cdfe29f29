"""When a message was received: by the middleware, whatever the node was busy with when it could have read it.

A node that reads a message late must not take it for a new one: its sender may be dead by then.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from inspect import Parameter, Signature
from time import monotonic_ns, time_ns
from typing import Any

from rclpy.node import Node
from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock

from fbql_common.core.topic_names import CLOCK

_NS = 1_000_000_000
_KEPT = 4096
"""Times of /clock that are kept."""
_EVERY_TIME = QoSProfile(
    history=HistoryPolicy.KEEP_LAST, depth=_KEPT, reliability=ReliabilityPolicy.BEST_EFFORT
)  # rclpy itself subscribes /clock as best effort, but keeps one message


class WithReception:
    """A subscription's callback: hands each message to `take`, with when the middleware received it, by the system clock [ns]; 0 where
    the middleware does not say."""

    __signature__ = Signature([Parameter(name, Parameter.POSITIONAL_ONLY) for name in ("message", "info")])
    """Two arguments: the sign for rclpy to add what is known of a message. Its events executor then hands over both as one tuple."""

    def __init__(self, take: Callable[[Any, int], None]) -> None:
        self._take = take

    def __call__(self, *taken: Any) -> None:
        message, info = taken[0] if len(taken) == 1 else taken
        self._take(message, info["received_timestamp"] or 0)


class AgeClock:
    """The time by which a node measures ages: simulated time, or the steady clock, which is never set."""

    def __init__(self, node: Node) -> None:
        self._clock = node.get_clock()
        self.is_simulated = self._clock.ros_time_is_active
        """Whether it is simulated time."""
        self._offset_ns = time_ns() - monotonic_ns()
        """By how much the system clock was ahead of the steady clock at the last message."""
        self._times: deque[tuple[int, int]] = deque(maxlen=_KEPT)
        """Times of /clock, and when the middleware received them."""
        if self.is_simulated:
            node.create_subscription(Clock, CLOCK, WithReception(self._on_clock), _EVERY_TIME)

    def now_ns(self) -> int:
        """The time now."""
        return self._clock.now().nanoseconds if self.is_simulated else monotonic_ns()

    def when_ns(self, received_ns: int, now_ns: int) -> int:
        """The time by this clock at which a message was received.

        Args:
            received_ns: the same by the system clock; 0: unknown, which counts as now.
            now_ns: the time by this clock.
        """
        if not received_ns:
            return now_ns
        if not self.is_simulated:
            # Where the system clock was set meanwhile, the message counts as older than it is rather than as newer.
            offset_ns, before_ns = time_ns() - now_ns, self._offset_ns
            self._offset_ns = offset_ns
            return min(received_ns - max(offset_ns, before_ns), now_ns)
        for at_ns, simulated_ns in reversed(self._times):
            if at_ns <= received_ns:
                return min(simulated_ns, now_ns)
        return now_ns

    def _on_clock(self, message: Clock, received_ns: int) -> None:
        self._times.append((received_ns, message.clock.sec * _NS + message.clock.nanosec))
