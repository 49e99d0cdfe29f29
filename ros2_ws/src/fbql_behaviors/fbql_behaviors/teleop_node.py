"""Keyboard teleoperation: keys into a terminal, velocity commands out.

Owns: the terminal, while it runs. Does not own: what the keys mean (fbql_behaviors.core.teleop). Publishes `cmd_vel`.
Parameters: `TeleopParameters`.
"""

from __future__ import annotations

from contextlib import ExitStack
from time import monotonic
from typing import Any

from fbql_common.core.topic_names import CMD_VEL
from fbql_common.core.twist import StampedTwist, Twist
from fbql_common.declare import declare_parameters
from fbql_common.qos import COMMAND_QOS
from fbql_common.spin import GraphNode, spin
from fbql_common.terminal.keys import Key
from fbql_common.terminal.screen import Line, Screen
from fbql_common.watch import steady_timer
from fbql_common.wire import MESSAGES, encode_stamped_twist, encode_twist

from fbql_behaviors.core.teleop import Teleop, TeleopParameters

_ZEROS_S = 0.5
"""How long zero commands are published after a release [s]: a single one may be lost."""
_STRONG = "1"
_KEYS = (
    ("up, w", "faster"),
    ("down, s", "slower, then backwards"),
    ("left, a", "turn left"),
    ("right, d", "turn right"),
    ("space", "stop"),
    ("q", "quit"),
)


PARAMETERS = (TeleopParameters,)


class TeleopNode(GraphNode):
    """A person at a terminal drives a robot."""

    def __init__(self, **options: Any) -> None:
        super().__init__("teleop", **options)
        self._parameters = declare_parameters(self, TeleopParameters)
        self._closing = ExitStack()
        self._screen = Screen()
        self._closing.enter_context(self._screen)
        self._teleop = Teleop(self._parameters)
        kind = StampedTwist if self._parameters.stamped else Twist
        self._publisher = self.create_publisher(MESSAGES[kind], CMD_VEL, COMMAND_QOS)
        self._moved_s = float("-inf")
        """When the robot was last commanded to move, or to stop."""
        self._timer = steady_timer(self, 1.0 / self._parameters.rate_hz, self._tick)

    def _tick(self) -> None:
        if self._screen.stop_asked:
            self._publish(Twist())
            self._screen.stopped()
            self._teleop.stop()
        now_s = monotonic()
        for key in self._screen.pressed():
            self._press(key, now_s)
        command = self._teleop.command(now_s)
        if command != Twist():
            self._moved_s = now_s
        if self._parameters.publish_when_idle or now_s - self._moved_s <= _ZEROS_S:
            self._publish(command)
        if self._screen.gone:
            self.finish()
        self._screen.show(self._page(command))

    def _press(self, key: Key, now_s: float) -> None:
        if key in (Key.FASTER, Key.SLOWER):
            self._teleop.drive(1 if key is Key.FASTER else -1, now_s)
        elif key in (Key.LEFT, Key.RIGHT):
            self._teleop.turn(1 if key is Key.LEFT else -1, now_s)
        elif key is Key.STOP:
            self._teleop.stop()
            self._moved_s = now_s
        elif key is Key.FINISH:
            self.finish()

    def _publish(self, command: Twist) -> None:
        if self._parameters.stamped:
            stamp_ns = self.get_clock().now().nanoseconds
            self._publisher.publish(encode_stamped_twist(StampedTwist(stamp_ns, self._parameters.frame, command)))
        else:
            self._publisher.publish(encode_twist(command))

    def _page(self, command: Twist) -> list[Line]:
        kind = "geometry_msgs/TwistStamped" if self._parameters.stamped else "geometry_msgs/Twist"
        listeners = self._publisher.get_subscription_count()
        heard = "nobody listens" if listeners == 0 else f"listening: {listeners}"
        limits = self._parameters
        return [
            [(f"{self._publisher.topic_name} ({kind}), {heard}", _STRONG)],
            [],
            *([(f"  {keys:10}{meaning}", "")] for keys, meaning in _KEYS),
            [],
            [(f"  speed {command.linear_x_m_s:+.2f} m/s (up to {limits.max_linear_m_s:g})", "")],
            [(f"  turn  {command.angular_z_rad_s:+.2f} rad/s (up to {limits.max_angular_rad_s:g})", "")],
            [],
            [(f"  Tap or hold; the robot stops {limits.release_s:g} s after the last key.", "")],
        ]

    def close(self) -> None:
        if self._moved_s > float("-inf"):
            self._publish(Twist())
        self._closing.close()


def main() -> int:
    """Runs the keyboard teleoperation."""
    return spin([TeleopNode])
