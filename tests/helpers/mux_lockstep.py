"""A mux that learns, as a node in this process, with the robot on a rail (`rail`) around it: sources, sensors, rewards and time.

Lockstep: a moment's messages are all received before /clock reaches it, so that the tick decides on them.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from fbql_common.core.mux_types import MuxDecision, RobotOutcome
from fbql_common.core.topic_names import CLOCK, DECISION, OUTCOME
from fbql_common.core.twist import Twist
from fbql_common.qos import POSE_QOS, STEP_QOS
from fbql_common.wire import MESSAGES, decode_mux_decision, encode_number, encode_outcome
from hand_driven import Bench
from mux_bench import OwnMux
from rail import PERIOD_NS, SOURCES, Rail, Result, learning
from rosgraph_msgs.msg import Clock

OBSERVATIONS = {"a_position": (-1.0, 1.0), "b_side": (-1.0, 1.0)}


def file_of(priorities: tuple[int, int] = (1, 2), more: str = "", **changes: Any) -> str:
    """The parameters of a mux that learns the rail."""
    parameters = learning(**changes)
    defaults = learning(behaviors=[], seed=0, learn=False, hold_s=0.8, play_s=0.4, fbql_batch_episodes=20)
    lines = [
        "/**/twist_mux:",
        "  ros__parameters:",
        "    use_sim_time: true",
        f"    learn: {str(parameters.learn).lower()}",
    ]
    for name in type(parameters).__dataclass_fields__:
        value = getattr(parameters, name)
        if value != getattr(defaults, name) and name not in ("learn", "behaviors"):
            lines.append(f"    {name}: {value}")
    lines += ["    topics:"]
    for (name, _), priority in zip(SOURCES.items(), priorities, strict=True):
        lines.append(f"      {name}: {{topic: {name}_vel, timeout: 0.25, priority: {priority}}}")
    lines.append("      joystick: {topic: joy_vel, timeout: 0.25, priority: 100}")
    lines.append("    observations:")
    for name, (low, high) in OBSERVATIONS.items():
        lines.append(
            f"      {name}: {{topic: {name}, type: std_msgs/msg/Float64, field: data, low: {low}, high: {high}, unit: m}}"
        )
    lines.append("    axes:")
    lines.append("      linear_x: {low: -1.0, high: 1.0, levels: 5}")
    lines.append("      angular_z: {low: -2.0, high: 2.0, levels: 5}")
    return "\n".join([*lines, more])


class LearningMux(OwnMux):
    """The mux and its robot."""

    def __init__(self, bench: Bench, place: Path, text: str, *arguments: str) -> None:
        super().__init__(bench, place, text, *arguments)
        self.decisions: list[MuxDecision] = []
        self.partner.create_subscription(
            MESSAGES[MuxDecision],
            DECISION,
            lambda data: self.decisions.append(decode_mux_decision(data)),
            STEP_QOS,
            raw=True,
        )
        self._clock = self.partner.create_publisher(Clock, CLOCK, POSE_QOS)
        self._sensors = [self.partner.create_publisher(MESSAGES[float], name, STEP_QOS) for name in OBSERVATIONS]
        self._outcome = self.partner.create_publisher(MESSAGES[RobotOutcome], OUTCOME, STEP_QOS)
        every = [self._clock, *self._sensors, self._outcome]
        bench.until(lambda: all(each.get_subscription_count() for each in every), "the mux to subscribe everything")
        bench.until(lambda: self.partner.count_publishers(DECISION) == 1, "decisions")
        self.now_ns = 0
        self.heard = 0
        learning_part = self.node._learning
        original = learning_part.mux.hear_observation

        def count(place: int, value: float, now_ns: int) -> None:
            self.heard += 1
            original(place, value, now_ns)

        learning_part.mux.hear_observation = count

    def sense(self, rail: Rail) -> None:
        """Publishes what is sensed, until the mux has it."""
        before = self.heard
        for publisher, (value,) in zip(self._sensors, rail.observed, strict=True):
            publisher.publish(encode_number(value))
        self.bench.until(lambda: self.heard == before + len(self._sensors), "the mux to receive what is sensed")

    def tell(self, result: Result) -> None:
        """Publishes what was achieved, until the mux has it."""
        outcomes = self.node._learning._outcomes
        before = outcomes.received
        self._outcome.publish(encode_outcome(RobotOutcome(self.now_ns, *result)))
        self.bench.until(lambda: outcomes.received > before, "the mux to receive what was achieved")

    def let_time_pass(self, decisions: int = 1) -> MuxDecision:
        """One period, and the decisions at its end."""
        self.now_ns += PERIOD_NS
        expected = len(self.decisions) + decisions
        message = Clock()
        message.clock.sec, message.clock.nanosec = divmod(self.now_ns, 10**9)
        self._clock.publish(message)
        self.bench.until(lambda: len(self.decisions) >= expected, "a decision")
        assert len(self.decisions) == expected
        return self.decisions[-1]

    def play(self, episodes: int) -> None:
        """Plays episodes as `rail.play` does."""
        rail = Rail()
        for _ in range(episodes):
            episode = self.decisions[-1].episode + 1 if self.decisions else 0
            rail.reset(episode)
            result = Result()
            while True:
                self.sense(rail)
                for name, speed in SOURCES.items():
                    self.send(f"{name}_vel", Twist(speed))
                if result != Result():
                    self.tell(result)
                out = len(self.out)
                decision = self.let_time_pass()
                if decision.terminated or decision.truncated:
                    break
                # The command is the one that the mux has put out last, before this decision or with it.
                self.bench.until(lambda: self.out and self.out[-1] == Twist(decision.command[0]), "the command")  # noqa: B023
                assert len(self.out) >= out
                result = rail.step(decision.command[0])
