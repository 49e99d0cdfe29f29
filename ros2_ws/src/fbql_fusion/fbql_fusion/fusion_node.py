"""The fusion node: world state and behavior outputs come in, the fused wheel command goes out and the run is recorded.

Owns: the session (schedule, learning, results) and the recording. Does not own: the world, which it asks for the
next episode, and the behaviors, whose answers it waits for.
Subscribes `world`, `behaviors/<name>`; publishes `wheel_command`, `fusion/decision`, `/diagnostics`; calls
`simulator/reset_episode`; serves `~/save_policy`. Parameters: `FusionNodeParameters`, `FusionParameters`.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path
from time import monotonic

from diagnostic_msgs.msg import DiagnosticArray
from fbql_common.core.errors import BadInput
from fbql_common.core.types import BehaviorOutput, WheelCommand, World
from fbql_common.declare import declare_all
from fbql_common.inputs import Input
from fbql_common.spin import BAD_INPUT, FAILED, GraphNode, spin
from fbql_common.topics import (
    DECISION,
    DIAGNOSTICS,
    POSE_QOS,
    RESET_EPISODE,
    STEP_QOS,
    WHEEL_COMMAND,
    WORLD,
    behavior_topic,
)
from fbql_common.watch import WorldWatch, steady_timer
from fbql_common.wire import decode_output, decode_world, encode_command, encode_decision
from fbql_msgs.msg import FusionDecision
from fbql_msgs.msg import WheelCommand as WheelCommandMsg
from fbql_msgs.srv import ResetEpisode, SavePolicy
from rclpy.task import Future

from fbql_fusion.core.assembly import Arrival, StepAssembly
from fbql_fusion.core.parameters import FusionParameters
from fbql_fusion.core.session import Session
from fbql_fusion.node_parameters import FusionNodeParameters
from fbql_fusion.policy_storage import load_policy
from fbql_fusion.run import INCOMPLETE, Run
from fbql_fusion.status import Status

_CHECK_PERIOD_S = 0.02
_RESET_AGAIN_S = 2.0
_WAITING_S = 5.0


class FusionNode(GraphNode):
    """Eqs. 5 and 6, or Subsumption, as a node."""

    def __init__(self) -> None:
        super().__init__("fusion")
        self._parameters, fusion = declare_all(self, FusionNodeParameters, FusionParameters)
        policy = load_policy(Path(self._parameters.policy)) if self._parameters.policy else None
        self._session = Session(fusion, policy)
        self._run = Run(self._parameters, self._session, self.resolve_topic_name, self.get_logger().error)
        self._assembly = StepAssembly(fusion.behaviors)
        self._status = Status(self._session)

        self._command_publisher = self.create_publisher(WheelCommandMsg, WHEEL_COMMAND, STEP_QOS)
        self._decision_publisher = self.create_publisher(FusionDecision, DECISION, STEP_QOS)
        self._diagnostics = self.create_publisher(DiagnosticArray, DIAGNOSTICS, POSE_QOS)
        self._world_input = Input(self, World, WORLD, decode_world, self._on_world, STEP_QOS)
        self._watch = WorldWatch(self, self._world_input)
        self._output_inputs = [
            Input(self, BehaviorOutput, behavior_topic(name), decode_output, partial(self._on_output, index), STEP_QOS)
            for index, name in enumerate(fusion.behaviors)
        ]
        self._reset = self.create_client(ResetEpisode, RESET_EPISODE)
        self.create_service(SavePolicy, "~/save_policy", self._on_save_policy)

        self._asked: tuple[int, int] | None = None
        """The episode and seed that the simulator was asked for and has not granted yet."""
        self._asked_s = float("-inf")
        self._began_s = self._waited_s = monotonic()
        self._command_data = b""
        self._command = WheelCommand(0, -1, -1, 0.0, 0.0)
        self._stopped = True
        self._started = False
        self._check_timer = steady_timer(self, _CHECK_PERIOD_S, self._check)
        self._flush_timer = steady_timer(self, self._parameters.flush_period_s, self._flush)
        self.get_logger().info(f"fusion: {fusion.controller} of {', '.join(fusion.behaviors)}; run in {self._run.path}")

    # The step

    def _on_world(self, world: World, data: bytes) -> None:
        if not self._watch.accept(world):
            return
        arrival = self._assembly.add_world(world, data)
        if arrival is Arrival.NEW:
            self._began_s = monotonic()
            if self._assembly.complete():
                self._decide()
        elif arrival is Arrival.AGAIN:
            self._command_publisher.publish(self._command_data)

    def _on_output(self, index: int, output: BehaviorOutput, data: bytes) -> None:
        self._assembly.add_output(index, output, data)
        if self._assembly.complete():
            self._decide()

    def _decide(self) -> None:
        assembly = self._assembly
        world = assembly.world
        assert world is not None
        try:
            command, decision = self._session.decide(world, assembly.answers())
        except BadInput as error:
            self.get_logger().error(str(error))
            self.finish(BAD_INPUT)
            return
        command_data, decision_data = encode_command(command), encode_decision(decision)
        self._command_publisher.publish(command_data)
        self._decision_publisher.publish(decision_data)
        self._run.record(world.stamp_ns, assembly.world_data, assembly.answer_data(), command_data, decision_data)
        assembly.decided()
        self._command, self._command_data, self._stopped = command, command_data, False
        self._status.decision = decision
        if world.ended:
            self._run.episode_ended()
            self._next_episode()

    # Episodes

    def _next_episode(self) -> None:
        self._asked = self._session.next_episode()
        if self._asked is None:
            self._run.close()
            self.finish(self._run.exit_code())
            return
        self._assembly.begin(self._asked[0])
        self._ask()

    def _ask(self) -> None:
        """Asks the simulator for the episode. Asking again does no harm (ResetEpisode.srv)."""
        assert self._asked is not None
        self._asked_s = monotonic()
        episode, seed = self._asked
        call = self._reset.call_async(ResetEpisode.Request(episode=int(episode), seed=int(seed)))
        call.add_done_callback(self._on_granted)

    def _on_granted(self, call: Future) -> None:
        answer = call.result()
        if answer.success:
            self._asked = None
        else:
            self.get_logger().error(f"the simulator refused an episode: {answer.message}")
            self.finish(FAILED)

    # What did not come

    def _check(self) -> None:
        """Begins when everything is there, asks again, and deals with what is late. On the steady clock."""
        now = monotonic()
        self._status.publish_due(now, self._diagnostics, self)
        if not self._started:
            missing = self._missing_inputs()
            if not missing:
                self._started = True
                self._next_episode()
            elif now - self._waited_s > _WAITING_S:
                self._waited_s = now
                self.get_logger().info(f"waiting for {', '.join(missing)}")
                for source in (self._world_input, *self._output_inputs):
                    source.check_types()
            return
        if self._asked is not None and now - self._asked_s > _RESET_AGAIN_S and self._reset.service_is_ready():
            self._ask()
        if self._assembly.world is not None:
            self._check_behaviors(now - self._began_s)
        age_s = self._world_input.age_s()
        if not self._stopped and age_s is not None and age_s > self._parameters.world_timeout_s:
            self.get_logger().warning(
                f"no world state for {self._parameters.world_timeout_s:g} s: the wheels are stopped"
            )
            self._stop_wheels()

    def _missing_inputs(self) -> list[str]:
        missing = [source.topic for source in (self._world_input, *self._output_inputs) if source.publishers() == 0]
        if not self._reset.service_is_ready():
            missing.append(f"service {self._reset.srv_name}")
        if self._command_publisher.get_subscription_count() == 0:
            missing.append(f"a subscriber of {self._command_publisher.topic_name}")
        return missing

    def _check_behaviors(self, waited_s: float) -> None:
        """Behaviors that do not answer: the step is decided without them, or ends the run (see the parameters)."""
        late_s, end_s = self._parameters.behavior_timeout_s, self._parameters.lockstep_timeout_s
        assembly = self._assembly
        world = assembly.world
        assert world is not None
        if 0 < end_s < waited_s:
            self.get_logger().error(
                f"no answer from {', '.join(assembly.missing())} to episode {world.episode}, step {world.step} within {end_s:g} s"
            )
            self.finish(FAILED)
        elif 0 < late_s < waited_s and assembly.all_heard:
            dropped = assembly.drop_missing()
            if dropped:
                self.get_logger().error(
                    f"no answer from {', '.join(dropped)} within {late_s:g} s: going on without; "
                    "nothing more is learned in this episode"
                )
            if True not in assembly.live:
                self.get_logger().error("no behavior answers: the wheels are stopped", throttle_duration_sec=1.0)
            self._decide()

    def _stop_wheels(self) -> None:
        """Wheels at rest until the next world state.

        The command carries the step that was decided last, so that a simulator in lockstep does not take it.
        """
        self._stopped = True
        self._command_publisher.publish(encode_command(self._command._replace(left_rad_s=0.0, right_rad_s=0.0)))

    # What is kept

    def _flush(self) -> None:
        self._run.flush()

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
        if self._run.incomplete:
            self.finish(INCOMPLETE)


def main() -> int:
    """Runs the fusion node."""
    return spin([FusionNode])
