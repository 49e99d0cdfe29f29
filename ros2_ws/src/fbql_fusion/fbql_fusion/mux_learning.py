"""The part of the mux node that learns, or plays a policy: observations, outcomes and a clock come in, decisions go out.

Owns: the ticks, the run directory. Does not own: the sources, the locks and the commands (twist_mux_node).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from fbql_common.core.errors import BadInput
from fbql_common.core.kernels import leave_interpreted
from fbql_common.core.mux_types import MuxDecision, RobotOutcome
from fbql_common.core.text import one_line
from fbql_common.core.topic_names import DECISION, OUTCOME
from fbql_common.inputs import Input
from fbql_common.message_types import message_class
from fbql_common.qos import STEP_QOS
from fbql_common.reception import AgeClock, WithReception
from fbql_common.spin import BAD_INPUT, GraphNode
from fbql_common.watch import steady_timer
from fbql_common.wire import MESSAGES, decode_number, decode_outcome, encode_mux_decision
from fbql_msgs.srv import SavePolicy
from rclpy.qos import qos_profile_sensor_data

from fbql_fusion.core.mux.learned import LearnedMux, Ticked
from fbql_fusion.core.mux.learning import MuxDescription, session_of
from fbql_fusion.core.mux.mux import Mux
from fbql_fusion.mux_recorder import MuxRecorder
from fbql_fusion.policy_storage import load_policy, save_policy

_FLUSH_PERIOD_S = 0.5
_LOOK_PERIOD_S = 1.0
_WARN_PERIOD_NS = 5_000_000_000
_DISCOVERY_LOOKS = 5
"""Looks in which an observation may be missing before that is said: publishers take some seconds to be discovered."""


class MuxLearning:
    """Makes a `LearnedMux` of a node's parameters, and lets it decide at each tick.

    Args:
        clock: the one that ages are measured with.
        act: called with each decision, to publish what follows from it.

    Raises:
        BadInput: parameters that are wrong, a policy that can't be used, or a message type that is not installed.
    """

    def __init__(
        self,
        node: GraphNode,
        description: MuxDescription,
        mux: Mux,
        clock: AgeClock,
        act: Callable[[Ticked], None],
    ) -> None:
        self._node = node
        self._age_clock = clock
        self._now_ns = clock.now_ns
        self._act = act
        learned = description.learned
        try:
            policy = load_policy(Path(learned.policy)) if learned.policy else None
            session = session_of(description, policy)
            self._observations = description.robot.observations
            self._kinds = {each.topic: _message_class(each.type_name) for each in self._observations}
        except BadInput as error:
            raise BadInput(f"{node.get_fully_qualified_name()}: {error}") from None
        self._unheard = {each.topic: each.type_name for each in self._observations}
        """Topics of observations on which nothing has come yet, and the types of their messages."""
        self.mux = LearnedMux(mux, session, description.robot, learned.safety_priority, learned.segment_s)
        self._session = session
        self._publisher = node.create_publisher(MESSAGES[MuxDecision], DECISION, STEP_QOS)
        self._sensors = [
            node.create_subscription(
                kind, topic, WithReception(partial(self._on_message, topic)), qos_profile_sensor_data
            )
            for topic, kind in self._kinds.items()
        ]
        self._outcomes = Input(node, RobotOutcome, OUTCOME, decode_outcome, self._on_outcome, STEP_QOS)
        self._rewards = Input(node, float, learned.reward_topic, decode_number, self._on_reward, STEP_QOS)
        node.create_service(SavePolicy, "~/save_policy", self._on_save_policy)
        complain = lambda text: node.get_logger().error(one_line(text))  # noqa: E731
        keeps = session.is_learning or learned.record or learned.run_directory
        self.run = MuxRecorder(description, session, node.resolve_topic_name, complain) if keeps else None
        period_s = description.learning.decision_period_s
        # In simulated time a tick belongs to a time of /clock; else to the steady clock, which is never set.
        sim = clock.is_simulated
        if session.is_learning and not sim:
            leave_interpreted()  # a joystick would not be heard meanwhile
        timer = partial(node.create_timer, clock=node.get_clock()) if sim else partial(steady_timer, node)
        self._tick_timer = timer(period_s, self._tick)
        self._look_timer = steady_timer(node, _LOOK_PERIOD_S, self._look)
        self._flush_timer = None if self.run is None else steady_timer(node, _FLUSH_PERIOD_S, self.run.flush)
        self._warned_ns = -_WARN_PERIOD_NS
        self._looks = 0
        self._say_what_it_does()

    def _say_what_it_does(self) -> None:
        parameters = self._session.parameters
        how = "learns" if self._session.is_learning else "plays"
        where = "" if self.run is None else f"; run in {self.run.path}"
        self._node.get_logger().info(
            one_line(f"{parameters.controller} {how} which of {', '.join(self._session.behaviors)} drives{where}")
        )

    # Messages

    def _on_message(self, topic: str, message: Any, received_ns: int) -> None:
        heard_ns = self._age_clock.when_ns(received_ns, self._now_ns())
        self._unheard.pop(topic, None)
        for place, each in enumerate(self._observations):
            if each.topic == topic:
                try:
                    value = each.path.read(message)
                except BadInput as error:
                    self._warn(f"observation {each.name}: {topic}: {error}")
                else:
                    self.mux.hear_observation(place, value, heard_ns)

    def _on_outcome(self, outcome: RobotOutcome, _data: bytes) -> None:
        self.mux.hear_outcome(outcome)

    def _on_reward(self, reward: float, _data: bytes) -> None:
        self.mux.hear_reward(reward)

    def _warn(self, text: str) -> None:
        now_ns = self._now_ns()
        if not 0 <= now_ns - self._warned_ns < _WARN_PERIOD_NS:
            self._warned_ns = now_ns
            self._node.get_logger().warning(one_line(text))

    # Decisions

    def _tick(self) -> None:
        try:
            ticked = self.mux.tick(lambda: (self._now_ns(), self._node.get_clock().now().nanoseconds))
        except BadInput as error:
            self._node.get_logger().error(one_line(error))
            self._node.finish(BAD_INPUT)
            return
        for each in ticked:
            self._act(each)  # at once: what is kept of an episode that was cut takes time to write
        for each in ticked:
            data = encode_mux_decision(each.decision)
            self._publisher.publish(data)
            if self.run is not None:
                self.run.record_decision(data, each.decision.stamp_ns)
        if self.mux.is_done:
            self._tick_timer.cancel()
            if self.run is not None:
                self.run.close()
            self._node.finish(0 if self.run is None else self.run.exit_code())

    @property
    def untold(self) -> str:
        """What is the matter where those who published outcomes have gone; empty if nothing is."""
        if not self.mux.is_lost:
            return ""
        then = f"only rewards on {self._rewards.topic} are learned from" if self.mux.is_told else "nothing is learned"
        return f"nobody publishes outcomes any more, {then}"

    def _look(self) -> None:
        """Notices publishers of outcomes, which say when episodes end, and a clock or an observation that does not arrive."""
        was_told = self.mux.is_told
        if self.mux.look(self._outcomes.publishers(), self._rewards.publishers()):
            self._node.get_logger().warning(
                one_line(f"{self._outcomes.topic}: {self.untold}; the episode ends as truncated")
            )
        elif self.mux.is_told and not was_told:
            self._node.get_logger().info(one_line(f"{self._outcomes.topic}: somebody publishes again"))
        for each in (self._outcomes, self._rewards):
            each.check_types()
        if self._now_ns() == 0:
            self._warn("use_sim_time is set and no /clock has come yet: nothing is decided before")
        self._looks += 1
        if self._looks <= _DISCOVERY_LOOKS:
            return
        for topic, type_name in self._unheard.items():
            names = ", ".join([each.name for each in self._observations if each.topic == topic])
            self._warn(f"observation {names}: no {type_name} has come on {topic} yet; until then it is unknown")

    # What is kept

    def _on_save_policy(self, request: SavePolicy.Request, response: SavePolicy.Response) -> SavePolicy.Response:
        try:
            policy = self._session.policy()
            if policy is None:
                raise BadInput(f"controller '{self._session.parameters.controller}' has learned nothing to save yet")
            if not request.path and self.run is None:
                raise BadInput("there is no run directory; give a path")
            path = Path(request.path) if request.path else self.run.path / "policy.npz"  # pyright: ignore[reportOptionalMemberAccess]
            save_policy(path, policy)
            response.success, response.message = True, str(path)
        except (BadInput, OSError) as error:
            response.success, response.message = False, str(error)
        return response

    def close(self) -> None:
        """Ends the run."""
        if self.run is not None:
            self.run.close()
            summary = self._session.summary()
            rate = "" if summary.success_rate is None else f", success rate {summary.success_rate:.1%}"
            self._node.get_logger().info(one_line(f"{summary.episodes} episodes{rate}; run in {self.run.path}"))
            if self.run.incomplete:
                self._node.finish(self.run.exit_code())


def _message_class(type_name: str) -> type[Any]:
    found = message_class(type_name)
    if found is None:
        raise BadInput(f"message type '{type_name}' is not installed here")
    return found
