"""The state of the match as diagnostics, for the launcher's live line and ROS diagnostics tools."""

from __future__ import annotations

from collections.abc import Sequence
from time import monotonic

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from fbql_common.core.types import Decision, Phase
from fbql_common.inputs import Input
from rclpy.node import Node
from rclpy.publisher import Publisher

from fbql_fusion.core.soccer_session import SoccerSession

_PERIOD_S = 0.25


class Status:
    """Publishes the state of a session, and how many messages its inputs dropped, a few times a second."""

    def __init__(self, session: SoccerSession, inputs: Sequence[Input]) -> None:
        self._session = session
        self._inputs = inputs
        self.decision: Decision | None = None
        self.reflects_s = 0.0
        """For how long the controller has been learning between two episodes; 0: it is not [s]."""
        self._due_s = 0.0
        self._last = (monotonic(), 0)

    def publish_due(self, now_s: float, publisher: Publisher, node: Node) -> None:
        """Publishes when it is due and there is something to report."""
        if now_s < self._due_s or self.decision is None:
            return
        self._due_s = now_s + _PERIOD_S
        last_s, last_steps = self._last
        rate = (self._session.steps - last_steps) / max(now_s - last_s, 1e-9)
        self._last = (now_s, self._session.steps)
        publisher.publish(self._message(self.decision, rate, node))

    def _message(self, decision: Decision, rate: float, node: Node) -> DiagnosticArray:
        counted = [record for record in self._session.records if record.phase is not Phase.GUIDED]
        outcomes = [record.outcome for record in counted]
        values = {
            "controller": decision.controller,
            "episode": str(decision.episode),
            "phase": Phase(decision.phase).name.lower(),
            "step": str(decision.step),
            "goals": str(outcomes.count("goal")),
            "own_goals": str(outcomes.count("own_goal")),
            "timeouts": str(outcomes.count("timeout")),
            "steps_per_s": f"{rate:.0f}",
            "dropped": str(sum(source.dropped for source in self._inputs)),
            "reflects_s": f"{self.reflects_s:.1f}",
            "weights": " ".join(
                f"{name} {weight:.2f}"
                for name, weight in zip(decision.behaviors, decision.learned_weights or decision.weights, strict=True)
            ),
        }
        status = DiagnosticStatus(
            level=DiagnosticStatus.WARN if decision.degraded else DiagnosticStatus.OK,
            name=f"{node.get_fully_qualified_name()[1:]}: match",
            message="degraded: a behavior did not answer"
            if decision.degraded
            else "learning between two episodes"
            if self.reflects_s
            else "playing",
            hardware_id="fusion",
            values=[KeyValue(key=key, value=value) for key, value in values.items()],
        )
        message = DiagnosticArray(status=[status])
        message.header.stamp = node.get_clock().now().to_msg()
        return message
