"""The mux node: velocity commands of several sources come in, those of the source that wins go out.

Owns: the clock, who drives. Does not own: the rules (fbql_fusion.core.mux), what is learned (mux_learning). Subscribes each
`topics.NAME.topic` and `locks.NAME.topic`; publishes `cmd_vel_out`, `~/driver`, `/diagnostics`; with `learn` or `policy` also
subscribes each `observations.NAME.topic`, `outcome` and `reward`, publishes `fusion/decision`, and serves `~/save_policy`.
Parameters: `MuxParameters`, `LearnedMuxParameters`, `SourceParameters`, `LockParameters`, `ObservationParameters`, `AxisParameters`
(fbql_fusion.core.mux.parameters), `MuxLearningParameters`. A YAML file for twist_mux works unchanged (docs/mux.md).
"""

from __future__ import annotations

from functools import partial
from time import monotonic_ns
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from fbql_common.core.text import one_line
from fbql_common.core.topic_names import DIAGNOSTICS, MUX_DRIVER, MUX_OUTPUT
from fbql_common.core.twist import StampedTwist, Twist
from fbql_common.inputs import TimedInput
from fbql_common.qos import COMMAND_QOS, LATCHED_QOS, POSE_QOS, SYSTEM_QOS
from fbql_common.reception import AgeClock
from fbql_common.spin import GraphNode, spin
from fbql_common.watch import steady_timer
from fbql_common.wire import (
    MESSAGES,
    decode_flag,
    decode_stamped_twist,
    decode_twist,
    encode_stamped_twist,
    encode_twist,
)
from rclpy.logging import LoggingSeverity
from std_msgs.msg import String

from fbql_fusion.core.mux.learned import LearnedMux, Ticked
from fbql_fusion.core.mux.mux import Mux
from fbql_fusion.core.mux.parameters import LearnedMuxParameters, MuxParameters
from fbql_fusion.core.tasks.twist.parameters import MuxLearningParameters
from fbql_fusion.mux_configuration import configure_mux, log_mux
from fbql_fusion.mux_learning import MuxLearning
from fbql_fusion.mux_status import diagnostics_of

_LOOK_PERIOD_S = 0.05
"""Period of the check for expired sources and locks, which no message announces [s]."""
_DIAGNOSTICS_PERIOD_S = 1.0
_SAY_PERIOD_NS = 1_000_000_000
"""Shortest time between two log lines about the driving source [ns]."""
_NOBODY = ""


PARAMETERS = (MuxParameters, LearnedMuxParameters, MuxLearningParameters)


class TwistMuxNode(GraphNode):
    """A mux as a node."""

    def __init__(self, **options: Any) -> None:
        super().__init__("twist_mux", **options)
        configured = configure_mux(self)
        config = configured.config
        self._mux = Mux(config)
        self._stamped = configured.stamped_output
        self._frame = ""
        """The frame of the last stamped command that was passed on."""
        self._age_clock = AgeClock(self)
        self._now_ns = self._age_clock.now_ns
        self._driver = self._said_driver = _NOBODY
        self._said_ns = -_SAY_PERIOD_NS
        self._says_each = self.get_logger().is_enabled_for(LoggingSeverity.DEBUG)

        self._publisher = self.create_publisher(
            MESSAGES[StampedTwist if self._stamped else Twist], MUX_OUTPUT, COMMAND_QOS
        )
        self._driver_publisher = self.create_publisher(String, MUX_DRIVER, LATCHED_QOS)
        self._diagnostics = self.create_publisher(DiagnosticArray, DIAGNOSTICS, POSE_QOS)
        self._locks = [
            TimedInput(self, bool, lock.topic, decode_flag, partial(self._on_lock, index), SYSTEM_QOS)
            for index, lock in enumerate(config.locks)
        ]
        self._sources = [
            TimedInput(
                self, StampedTwist, source.topic, decode_stamped_twist, partial(self._on_stamped, index), SYSTEM_QOS
            )
            if source.name in configured.stamped_sources
            else TimedInput(self, Twist, source.topic, decode_twist, partial(self._on_twist, index), SYSTEM_QOS)
            for index, source in enumerate(config.sources)
        ]
        self._learning: MuxLearning | None = None
        self._decide: LearnedMux | Mux = self._mux
        """Decides whether a command is passed on."""
        self._kept: dict[int, tuple[Twist | StampedTwist, bytes]] = {}
        """The last command of each source that was not passed on; only where a tick may still do so."""
        if configured.description.is_learned:
            self._learning = MuxLearning(self, configured.description, self._mux, self._age_clock, self._act)
            self._decide = self._learning.mux
        elif configured.description.learned.record:
            self.get_logger().warning("nothing is recorded, because nothing is decided: set learn or policy")
        self._checked = 0
        self._look_timer = steady_timer(self, _LOOK_PERIOD_S, self._look)
        self._diagnostics_timer = steady_timer(self, _DIAGNOSTICS_PERIOD_S, self._publish_diagnostics)
        self._publish_driver()
        log_mux(self, configured, self._publisher.topic_name)

    # Messages

    def _on_twist(self, index: int, twist: Twist, data: bytes, received_ns: int) -> None:
        if self._hear(index, twist, received_ns):
            self._send(twist, data)
        elif self._learning is not None:
            self._kept[index] = twist, data

    def _on_stamped(self, index: int, stamped: StampedTwist, data: bytes, received_ns: int) -> None:
        if self._hear(index, stamped.twist, received_ns):
            self._send(stamped, data)
        elif self._learning is not None:
            self._kept[index] = stamped, data

    def _send(self, command: Twist | StampedTwist, data: bytes) -> None:
        """Publishes a command that came as these bytes."""
        if isinstance(command, StampedTwist):
            self._frame = command.frame
            self._publish(data if self._stamped else encode_twist(command.twist))
        else:
            self._publish(self._stamp(command) if self._stamped else data)

    def _publish(self, data: bytes) -> None:
        self._publisher.publish(data)
        if self._learning is not None and self._learning.run is not None:
            self._learning.run.record_command(data, self.get_clock().now().nanoseconds)

    def _act(self, ticked: Ticked) -> None:
        """Publishes what follows from a decision."""
        if ticked.pass_on is not None:
            name = self._mux.config.sources[ticked.pass_on].name
            self._note_driver(name)
            self._send(*self._kept[ticked.pass_on])
            if self._says_each:
                self.get_logger().debug(one_line(f"{name}: last command passed on at {self._now_ns()}"))
        elif ticked.send is not None:
            decision = ticked.decision
            if not (decision.terminated or decision.truncated):
                weighted = zip(decision.behaviors, decision.weights, strict=True)
                self._note_driver(" + ".join([name for name, weight in weighted if weight > 0.0]))
            self._publish(self._stamp(ticked.send) if self._stamped else encode_twist(ticked.send))

    def _hear(self, index: int, twist: Twist, received_ns: int) -> bool:
        now_ns = self._now_ns()
        heard_ns = self._age_clock.when_ns(received_ns, now_ns)
        passed = self._decide.hear(index, twist, now_ns, heard_ns)
        if passed:
            self._note_driver(self._mux.config.sources[index].name)
        if self._says_each:
            name, what = self._mux.config.sources[index].name, "passed on" if passed else "not passed on"
            when = f"received at {heard_ns}, read at {now_ns}"
            self.get_logger().debug(one_line(f"{name}: {what}, {when}, {twist.linear_x_m_s!r} m/s"))
        return passed

    def _on_lock(self, index: int, on: bool, _data: bytes, received_ns: int) -> None:
        now_ns = self._now_ns()
        heard_ns = self._age_clock.when_ns(received_ns, now_ns)
        self._mux.hear_lock(index, on, heard_ns)
        self._stop_if_locked(now_ns)
        if self._says_each:
            name = self._mux.config.locks[index].name
            what = "on" if on else "off"
            self.get_logger().debug(one_line(f"{name}: {what}, received at {heard_ns}, read at {now_ns}"))

    def _stamp(self, twist: Twist) -> bytes:
        """Adds a header to a command without one, or to a zero."""
        return encode_stamped_twist(StampedTwist(self.get_clock().now().nanoseconds, self._frame, twist))

    def _stop_if_locked(self, now_ns: int) -> None:
        if self._mux.zero_due(now_ns):
            self._publish(self._stamp(Twist()) if self._stamped else encode_twist(Twist()))

    # Who drives

    def _look(self) -> None:
        now_ns = self._now_ns()
        self._stop_if_locked(now_ns)
        if self._mux.driver(now_ns) is None:
            self._note_driver(_NOBODY)
        if self._driver != self._said_driver and monotonic_ns() - self._said_ns >= _SAY_PERIOD_NS:
            self._said_ns, self._said_driver = monotonic_ns(), self._driver
            self.get_logger().info(one_line(f"{self._driver or 'nobody'} drives"))

    def _note_driver(self, name: str) -> None:
        if name != self._driver:
            self._driver = name
            self._publish_driver()

    def _publish_driver(self) -> None:
        self._driver_publisher.publish(String(data=self._driver))

    def _publish_diagnostics(self) -> None:
        dropped = [each.dropped for each in self._sources]
        snapshot = self._mux.snapshot(self._now_ns())
        problem = "" if self._learning is None else self._learning.untold
        stamp = self.get_clock().now().to_msg()
        self._diagnostics.publish(diagnostics_of(self.get_name(), snapshot, dropped, stamp, problem))
        # One input per call: checking all would add noticeable latency to commands.
        inputs = [*self._sources, *self._locks]
        each = inputs[self._checked % len(inputs)]
        self._checked += 1
        if each.publishers() == 0:
            each.check_types()

    def close(self) -> None:
        if self._learning is not None:
            self._learning.close()


def main() -> int:
    """Runs the mux node."""
    return spin([TwistMuxNode])
