"""The fusion node: world state and behavior outputs come in, the fused wheel command goes out and the run is recorded.

Owns: the session (schedule, learning, results) and the recording. Does not own: the world, from which it requests the
next episode, and the behaviors, for whose answers it waits. Subscribes `world`, `behaviors/<name>`; publishes
`wheel_command`, `fusion/decision`, `/diagnostics`; calls `simulator/reset_episode`; serves `~/save_policy`. Parameters:
`FusionNodeParameters`, `FusionParameters`.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path
from time import monotonic
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from fbql_common.core.errors import BadInput
from fbql_common.core.text import one_line
from fbql_common.core.topic_names import DECISION, DIAGNOSTICS, WHEEL_COMMAND, WORLD, behavior_topic
from fbql_common.core.types import BehaviorOutput, WheelCommand, World
from fbql_common.declare import declare_all, given_text, is_given
from fbql_common.inputs import Input
from fbql_common.qos import POSE_QOS, STEP_QOS
from fbql_common.spin import BAD_INPUT, FAILED, GraphNode, spin
from fbql_common.twins import Twins
from fbql_common.watch import WorldWatch, steady_timer
from fbql_common.wire import decode_output, decode_world, encode_command, encode_decision
from fbql_msgs.msg import FusionDecision
from fbql_msgs.msg import WheelCommand as WheelCommandMsg
from fbql_msgs.srv import ResetEpisode, SavePolicy
from rclpy.clock import Clock
from rclpy.clock_type import ClockType

from fbql_fusion.controller_loading import register_installed, resolve_controller
from fbql_fusion.core.assembly import Arrival, PendingStep, StepAssembly
from fbql_fusion.core.parameters import FusionParameters
from fbql_fusion.core.registry import fusion_parameters
from fbql_fusion.core.soccer_session import SoccerSession, imagines, plays_instead
from fbql_fusion.episodes import Episodes
from fbql_fusion.node_parameters import DEFAULT_GOALS, FusionNodeParameters
from fbql_fusion.policy_storage import load_policy
from fbql_fusion.reflection import Reflection
from fbql_fusion.run_recorder import INCOMPLETE, RunRecorder
from fbql_fusion.shipped import shipped_policy
from fbql_fusion.status import Status
from fbql_fusion.team_files import read_playing_trees

_CHECK_PERIOD_S = 0.02
SHIPPED, NO_POLICY = "shipped", "none"
"""Values of the parameter `policy` that are not files."""
_SAY_PERIOD_S = 5.0
"""How often the node reports what it waits for [s]."""


PARAMETERS = (FusionNodeParameters, FusionParameters)


class FusionNode(GraphNode):
    """A session with its controller as a node."""

    def __init__(self, **options: Any) -> None:
        super().__init__("fusion", **options)
        controller = _know_controller(self)
        usual = _usual(self, controller)
        self._settings, fusion = declare_all(
            self,
            FusionNodeParameters,
            fusion_parameters(controller or given_text(self, "controller") or usual.get("controller", "")),
            defaults=usual,
        )
        if controller not in ("", fusion.controller):
            raise BadInput(
                f"{self.get_fully_qualified_name()}: parameter 'controller' is '{fusion.controller}', but 'controller_file' "
                f"has '{controller}'; set controller:={controller}"
            )
        file = _policy_file(self._settings.policy)
        self._settings = replace(self._settings, policy=str(file or ""))
        trees = read_playing_trees([Path(path) for path in self._settings.tree_files]) if imagines(fusion) else ()
        self._session = SoccerSession(fusion, None if file is None else load_policy(file), trees)
        if instead := plays_instead(fusion, trees):
            self.get_logger().warning(one_line(instead))
        self._assembly = StepAssembly(fusion.behaviors)
        self._episodes = Episodes(
            self, self._session, self._assembly, self._settings.world_timeout_s, lambda: self._run.episode_restarted()
        )

        self._command_publisher = self.create_publisher(WheelCommandMsg, WHEEL_COMMAND, STEP_QOS)
        self._decision_publisher = self.create_publisher(FusionDecision, DECISION, STEP_QOS)
        self._diagnostics = self.create_publisher(DiagnosticArray, DIAGNOSTICS, POSE_QOS)
        self._world_input = Input(self, World, WORLD, decode_world, self._on_world, STEP_QOS)
        self._watch = WorldWatch(self, self._world_input)
        output_inputs = [
            Input(self, BehaviorOutput, behavior_topic(name), decode_output, partial(self._on_output, index), STEP_QOS)
            for index, name in enumerate(fusion.behaviors)
        ]
        self._inputs = (self._world_input, *output_inputs)
        self._status = Status(self._session, self._inputs)
        self.create_service(SavePolicy, "~/save_policy", self._on_save_policy)
        self._twins = {
            "another fusion node runs": Twins(self, WHEEL_COMMAND, SavePolicy),
            "more than one simulator runs": Twins(self, WORLD, ResetEpisode, own=False),
        }
        complain = lambda text: self.get_logger().error(one_line(text))  # noqa: E731
        self._run = RunRecorder(self._settings, self._session, self.resolve_topic_name, complain)

        self._started = False
        self._reflection: Reflection | None = None
        """What the controller does between two episodes, if that takes long and is under way."""
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._command: WheelCommand | None = None
        """The command of the step that was decided last."""
        self._command_data = b""
        self._stopped = True
        self._given_up: set[str] = set()
        """Behaviors that were reported missing in this episode."""
        self._rejected = 0
        self._made_s = self._began_s = self._checked_s = self._said_s = monotonic()
        self._check_timer = steady_timer(self, _CHECK_PERIOD_S, self._check)
        self._flush_timer = steady_timer(self, self._settings.flush_period_s, self._run.flush)
        policy = (
            "" if file is None else f" with the {'shipped policy' if file == shipped_policy() else f'policy {file}'}"
        )
        named = one_line(f"{fusion.controller}{policy} of {', '.join(fusion.behaviors)}; run in {self._run.path}")
        self.get_logger().info(f"fusion: {named}")

    # The step

    def _on_world(self, world: World, data: bytes) -> None:
        if not self._watch.accept(world):
            return
        idle = self._assembly.oldest() is None
        arrival = self._assembly.add_world(world, data)
        if arrival is Arrival.FOREIGN:
            self._episodes.heard_foreign(world)
            return
        now = self._episodes.heard_s = monotonic()
        if arrival is Arrival.NEW:
            if idle:
                self._began_s = now
            self._decide(self._assembly.complete())
        elif arrival is Arrival.DECIDED:
            self._command_publisher.publish(self._command_data)

    def _on_output(self, index: int, output: BehaviorOutput, data: bytes) -> None:
        self._assembly.add_output(index, output, data)
        self._decide(self._assembly.complete())

    def _decide(self, step: PendingStep | None) -> None:
        if step is None or step.world is None:
            return
        world = step.world
        try:
            command, decision = self._session.decide(world, step.outputs)
        except BadInput as error:
            self.get_logger().error(str(error))
            self.finish(BAD_INPUT)
            return
        command_data, decision_data = encode_command(command), encode_decision(decision)
        self._command_publisher.publish(command_data)
        self._decision_publisher.publish(decision_data)
        self._run.record(world.stamp_ns, step.world_data, step.data, command_data, decision_data)
        self._assembly.decided(step)
        self._command, self._command_data, self._stopped = command, command_data, False
        self._status.decision = decision
        self._began_s = monotonic()
        if world.ended:
            self._run.episode_ended()
            self._next_episode()

    def _next_episode(self) -> None:
        self._given_up.clear()
        self._episodes.under_way = False
        if self._session.reflects_next:
            self._reflection = Reflection(self._session)
        else:
            self._begin(self._session.next_episode())

    def _begin(self, asked: tuple[int, int] | None) -> None:
        """Requests an episode; None ends the run."""
        if asked is not None:
            self._episodes.begin(*asked)
            return
        self._run.close()
        self.finish(self._run.exit_code())

    def _begin_after(self, reflection: Reflection) -> None:
        """Begins the next episode if the controller has learned enough."""
        if reflection.is_under_way:
            return
        self._reflection = None
        try:
            self._begin(reflection.next_episode())
        except BadInput as error:
            self.get_logger().error(str(error))
            self.finish(BAD_INPUT)

    # What did not come

    def _check(self) -> None:
        """Begins when everything is there, repeats requests, and handles late inputs, on the steady clock."""
        now = monotonic()
        stood_still_s = now - self._checked_s - _CHECK_PERIOD_S
        self._checked_s = now
        if stood_still_s > _CHECK_PERIOD_S:
            # In that time it was this process that kept the others waiting.
            self._began_s += stood_still_s
            self._episodes.heard_s += stood_still_s
        self._status.reflects_s = self._reflection.lasts_s if self._reflection is not None else 0.0
        self._status.publish_due(now, self._diagnostics, self)
        if self._has_twins() or not self.is_settled:
            return
        if self._reflection is not None:
            self._begin_after(self._reflection)
            return
        if not self._started:
            self._start(now)
            return
        self._episodes.check(now)
        if self._assembly.oldest() is not None:
            self._check_behaviors(now)
        self._check_world(now)
        if self._session.rejections.total > self._rejected:
            self._rejected = self._session.rejections.total
            self._say_again_and_again(f"not used so far: {self._session.rejections}")

    def _has_twins(self) -> bool:
        """Ends the run where messages of a second simulator or fusion node could get into it."""
        for what, twins in self._twins.items():
            if names := twins.found():
                self.get_logger().error(
                    f"{what} in this graph: {names}; the run ends, and nothing more is learned; end one of them, or give it "
                    "another ROS_DOMAIN_ID"
                )
                self.finish(FAILED)
                return True
        return False

    def _start(self, now: float) -> None:
        missing = [source.topic for source in self._inputs if source.publishers() == 0]
        if not self._episodes.can_ask():
            missing.append(f"service {self._episodes.service}")
        if self._command_publisher.get_subscription_count() == 0:
            missing.append(f"a subscriber of {self._command_publisher.topic_name}")
        if not missing and any(twins.are_suspected for twins in self._twins.values()):
            return
        if not missing:
            self._started = True
            self._next_episode()
        elif 0 < self._settings.start_timeout_s < now - self._made_s:
            self.get_logger().error(
                f"can't begin: after {self._settings.start_timeout_s:g} s there is no matching {', '.join(missing)}"
            )
            self.finish(FAILED)
        elif self._due(now):
            self.get_logger().info(f"waiting for {', '.join(missing)}")
            for source in self._inputs:
                source.check_types()

    def _check_behaviors(self, now: float) -> None:
        """Handles behaviors that do not answer: the step is decided without them, or ends the run (see the
        parameters)."""
        late_s, end_s = self._settings.behavior_timeout_s, self._settings.lockstep_timeout_s
        waited_s = now - self._began_s
        if 0 < end_s < waited_s:
            self.get_logger().error(f"no answer from {', '.join(self._assembly.missing())} within {end_s:g} s")
            self.finish(FAILED)
        elif 0 < late_s < waited_s and self._command is not None:
            self._decide_without(self._assembly.drop_missing(), late_s)
        elif waited_s > _SAY_PERIOD_S and self._due(now):
            self.get_logger().info(f"waiting for an answer from {', '.join(self._assembly.missing())}")

    def _decide_without(self, dropped: list[str], late_s: float) -> None:
        given_up = [name for name in dropped if name not in self._given_up]
        if given_up:
            self._given_up.update(given_up)
            self.get_logger().error(
                f"no answer from {', '.join(given_up)} within {late_s:g} s: continuing without it; "
                "nothing more is learned in this episode"
            )
        step = self._assembly.complete()
        if step is None:
            self._say_again_and_again("no behavior answers: the wheels are stopped")
            step = self._assembly.newest()
        self._decide(step)

    def _check_world(self, now: float) -> None:
        """Handles missing world states: the wheels are stopped, and the run may end (see the parameters)."""
        stop_s, end_s = self._settings.world_timeout_s, self._settings.lockstep_timeout_s
        waited_s = now - self._episodes.heard_s
        if 0 < end_s < waited_s:
            self.get_logger().error(f"no world state of the episode on {self._world_input.topic} within {end_s:g} s")
            self.finish(FAILED)
        elif not self._stopped and self._episodes.under_way and waited_s > stop_s:
            self.get_logger().warning(f"no world state of the episode for {stop_s:g} s: the wheels are stopped")
            self._stop_wheels()

    def _stop_wheels(self) -> None:
        """Stops the wheels until the next world state.

        The command carries the step that was decided last, so that a simulator in lockstep does not take it.
        """
        self._stopped = True
        if self._command is not None:
            self._command_publisher.publish(encode_command(self._command._replace(left_rad_s=0.0, right_rad_s=0.0)))

    def _say_again_and_again(self, text: str) -> None:
        """Logs an error, at most once a second of the steady clock; by default that would be the wall clock's."""
        self.get_logger().error(text, throttle_duration_sec=1.0, throttle_time_source_type=self._steady)

    def _due(self, now: float) -> bool:
        """Whether it is time to report again what is awaited."""
        due = now - self._said_s > _SAY_PERIOD_S
        if due:
            self._said_s = now
        return due

    # What is kept

    def _on_save_policy(self, request: SavePolicy.Request, response: SavePolicy.Response) -> SavePolicy.Response:
        try:
            response.message = self._run.save_policy(Path(request.path) if request.path else None)
            response.success = True
        except (BadInput, OSError) as error:
            response.success, response.message = False, str(error)
        return response

    def close(self) -> None:
        if not self._stopped:
            self._stop_wheels()
        self._run.close()
        self.get_logger().info(f"fusion: {_result_text(self._session)}; run in {self._run.path}")
        if self._run.incomplete:
            self.finish(INCOMPLETE)


def _result_text(session: SoccerSession) -> str:
    """What was played of what was asked for, in words."""
    summary, asked = session.summary(), session.parameters
    rate = "" if summary.success_rate is None else f", success rate {summary.success_rate:.1%}"
    if 0 < asked.episodes <= summary.episodes or 0 < asked.goals <= summary.goals:
        return f"done: goals {summary.goals}, episodes {summary.episodes}{rate}"
    goals = f"goals {summary.goals}{f' of {asked.goals}' if asked.goals else ''}"
    return f"ended early: {goals}, episodes {summary.episodes}{f' of {asked.episodes}' if asked.episodes else ''}"


def _usual(node: FusionNode, controller: str) -> dict[str, Any]:
    """What the node plays by default: the same as bringup.

    Args:
        controller: the one in `controller_file`, if there is one.
    """
    usual: dict[str, Any] = {}
    if not (controller or is_given(node, "controller") or is_given(node, "preset")):
        usual["controller"] = "fbql"
    plays_fbql = "fbql" in (usual.get("controller"), given_text(node, "controller"))
    if plays_fbql and not any(is_given(node, name) for name in ("behaviors", "guided", "policy")):
        usual["policy"] = SHIPPED
    if not (is_given(node, "goals") or is_given(node, "episodes")):
        usual["goals"] = DEFAULT_GOALS
    return usual


def _policy_file(policy: str) -> Path | None:
    """The file that the parameter `policy` means."""
    if policy in ("", NO_POLICY):
        return None
    return shipped_policy() if policy == SHIPPED else Path(policy)


def _know_controller(node: FusionNode) -> str:
    """Registers a controller from outside this package, with its parameters, before they are declared.

    Returns the name of the one in `controller_file`, or "". Raises BadInput.
    """
    if source := given_text(node, "controller_file"):
        return resolve_controller(source).name
    if name := given_text(node, "controller"):
        register_installed(name)
    return ""


def main() -> int:
    """Runs the fusion node."""
    return spin([FusionNode])
