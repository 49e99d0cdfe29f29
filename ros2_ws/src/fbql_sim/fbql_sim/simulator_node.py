"""The simulator node: wheel commands in, world states out.

Owns: the world loop, simulated time, the order of steps. Does not own: the choice of the next episode (a service request)
and the reward.
Publishes `world`, and for ROS tools `robot/pose`, `ball/pose`, `wall/pose`, `/clock`, `~/markers`, `/diagnostics`;
subscribes `wheel_command`; serves `~/reset_episode`. Parameters: `SimulatorNodeParameters`, `SimulationParameters`.

Lockstep (default): the world steps when the command for its (episode, step) arrives; until then the world state is
published again periodically, so that a lost message or a late subscriber delays the run but does not end it.
Real time: the world steps on the steady clock with the latest command, and stops the wheels when that is too old.
A command is ignored when it is of another episode, from the future, or older than an earlier one; in lockstep also when its
stamp is not the world state's, because it then answers an earlier play of the same episode. A command without a stamp is
taken as current.
"""

from __future__ import annotations

from dataclasses import dataclass
from time import monotonic
from typing import Any

from fbql_common.core.parameters import parameter
from fbql_common.core.topic_names import WHEEL_COMMAND, WORLD
from fbql_common.core.types import WheelCommand
from fbql_common.declare import declare_all
from fbql_common.inputs import Input
from fbql_common.qos import STEP_QOS
from fbql_common.spin import FAILED, GraphNode, spin
from fbql_common.twins import Twins
from fbql_common.watch import steady_timer
from fbql_common.wire import NS, decode_command, encode_world
from fbql_msgs.msg import WorldState
from fbql_msgs.srv import ResetEpisode

from fbql_sim.core.parameters import SimulationParameters
from fbql_sim.core.world_loop import WorldLoop
from fbql_sim.views import Views

IDLE_EPISODE = -1
"""The episode before the first request: the start of `seed` is shown, and can be driven by hand."""


@dataclass(frozen=True)
class SimulatorNodeParameters:
    """Parameters of the simulator node beside those of the physics and the task."""

    seed: int = parameter(0, "seed of the start that is shown before the first reset", low=0)
    realtime: float = parameter(
        0.0, "speed relative to real time; 0: lockstep, as fast as commands come", low=0.0, high=100.0
    )
    command_timeout_s: float = parameter(
        0.25,
        "real time: a command older than this, both in real and in simulated time, stops the wheels",
        unit="s",
        low=0.01,
        high=10.0,
    )
    request_period_s: float = parameter(
        0.25, "an unanswered world state is published again after this", unit="s", low=0.02, high=10.0
    )
    lockstep_timeout_s: float = parameter(
        0.0,
        "lockstep: an episode under way without a command for this long ends the run; 0: waits forever",
        unit="s",
        low=0.0,
        high=3600.0,
    )


PARAMETERS = (SimulatorNodeParameters, SimulationParameters)


class SimulatorNode(GraphNode):
    """The robot soccer field as a node."""

    def __init__(self, **options: Any) -> None:
        super().__init__("simulator", **options)
        self._settings, simulation = declare_all(self, SimulatorNodeParameters, SimulationParameters)
        self._loop = WorldLoop(simulation)
        self._world = self._loop.reset(IDLE_EPISODE, self._settings.seed)
        self._seed = self._settings.seed
        self._command: WheelCommand | None = None
        self._command_s = float("-inf")
        self._stopped = False
        self._published_s = float("-inf")
        self._stepped_s = monotonic()
        self._steps = 0
        self._missed_ticks = 0
        self._publisher = self.create_publisher(WorldState, WORLD, STEP_QOS)
        self._views = Views(self, always=self._settings.realtime > 0)
        self._input = Input(self, WheelCommand, WHEEL_COMMAND, decode_command, self._on_command, STEP_QOS)
        self.create_service(ResetEpisode, "~/reset_episode", self._on_reset)
        self._twins = Twins(self, WORLD, ResetEpisode)
        self._speed = self._settings.realtime
        if self._speed > 0:
            self._period_s = self._loop.dt_s / self._speed
            # In slow motion the latest command may exceed the limit before the next one is due.
            self._patience_s = self._settings.command_timeout_s * max(1.0, 1.0 / self._speed)
            self._timer = steady_timer(self, self._period_s, self._tick)
        self._watch = steady_timer(self, min(self._settings.request_period_s, 0.25), self._check)
        mode = f"{self._speed:g}x real time" if self._speed > 0 else "lockstep"
        self.get_logger().info(f"simulator: {mode}, step {1e3 * self._loop.dt_s:.1f} ms")

    def _publish(self) -> None:
        if not self.is_settled:
            return  # another simulator may be there, whose graph this world state must not disturb
        self._publisher.publish(encode_world(self._world))
        self._views.show(self._world)
        self._published_s = monotonic()

    def _step(self, left_rad_s: float, right_rad_s: float) -> None:
        self._world = self._loop.step(left_rad_s, right_rad_s)
        self._steps += 1
        self._stepped_s = monotonic()
        self._publish()

    def _on_command(self, command: WheelCommand, _data: bytes) -> None:
        world = self._world
        if command.stamp_ns == 0:  # no stamp: the input has warned, and the command is taken as current
            command = command._replace(stamp_ns=world.stamp_ns)
        if self._speed > 0:
            self._keep(command)
        elif (command.episode, command.step) == (world.episode, world.step):
            if command.stamp_ns != world.stamp_ns:
                self._input.drop(f"the command for step {command.step} has the stamp of another world state")
            elif not world.ended:
                self._step(command.left_rad_s, command.right_rad_s)
        elif command.stamp_ns > world.stamp_ns:
            self._input.drop(
                f"a command for episode {command.episode}, step {command.step}, which has not been reached yet"
            )
        # An older command answers a world state that was published twice: ignore it.

    def _keep(self, command: WheelCommand) -> None:
        """Keeps the latest command of this episode for the next steps."""
        age_s = (self._world.stamp_ns - command.stamp_ns) / NS
        if command.episode != self._world.episode:
            return  # a late answer to an episode that is over
        if age_s > self._patience_s * self._speed:
            self._input.drop(f"the command's stamp is {age_s:.2f} s old")
        elif age_s < 0:
            self._input.drop(f"the command's stamp is {-age_s:.2f} s ahead of simulated time")
        elif self._command is not None and command.stamp_ns < self._command.stamp_ns:
            self._input.drop(f"the command for step {command.step} is older than the last")
        else:
            self._command, self._command_s = command, monotonic()

    def _tick(self) -> None:
        if self._world.ended or not self.is_settled:
            return
        now = monotonic()
        self._missed_ticks += max(0, round((now - self._stepped_s) / self._period_s) - 1)
        command = self._command
        if command is None:
            self._step(0.0, 0.0)
        elif now - self._command_s > self._patience_s:
            if not self._stopped:
                self.get_logger().warning(f"no command for {self._patience_s:g} s: the wheels are stopped")
            self._stopped = True
            self._step(0.0, 0.0)
        else:
            if self._stopped:
                self.get_logger().info("commands come again: the wheels turn")
            self._stopped = False
            self._step(command.left_rad_s, command.right_rad_s)

    def _on_reset(self, request: ResetEpisode.Request, response: ResetEpisode.Response) -> ResetEpisode.Response:
        episode, seed = int(request.episode), int(request.seed)
        if episode < 0 or seed < 0:
            response.success, response.message = False, f"episode {episode} and seed {seed} must be 0 or more"
            return response
        if (self._world.episode, self._world.step, self._seed) != (episode, 0, seed):
            if self._world.episode == IDLE_EPISODE:
                self._missed_ticks = 0  # nobody misses those before the match
            self._world, self._seed = self._loop.reset(episode, seed), seed
            self._command = None
        self._stepped_s = monotonic()
        self._publish()
        response.success = True
        return response

    def _check(self) -> None:
        """Repeats an unanswered world state, and ends a run that gets no commands any more."""
        self._views.refresh(self._counts())
        if self._input.received == 0 and self._input.publishers() == 0:
            self._input.check_types()
        if twins := self._twins.found():
            self.get_logger().error(
                f"another simulator runs in this graph: {twins}; end one of them, or give it another ROS_DOMAIN_ID"
            )
            self.finish(FAILED)
            return
        now = monotonic()
        timeout_s = self._settings.lockstep_timeout_s
        under_way = self._world.episode >= 0 and not self._world.ended and self._speed == 0
        if under_way and 0 < timeout_s < now - self._stepped_s:
            self.get_logger().error(
                f"no command on {self._input.topic} for episode {self._world.episode}, step {self._world.step} "
                f"within {timeout_s:g} s; publishers there: {self._input.publishers()}"
            )
            self.finish(FAILED)
        elif now - self._published_s >= self._settings.request_period_s:
            self._publish()

    def _counts(self) -> dict[str, int]:
        return {
            "episode": self._world.episode,
            "step": self._world.step,
            "steps": self._steps,
            "missed_ticks": self._missed_ticks,
            "commands_dropped": self._input.dropped,
        }


def main() -> int:
    """Runs the simulator."""
    return spin([SimulatorNode])
