"""The simulator as a process of the graph, and the node `instructor` that drives it.

The simulator runs in lockstep: it steps when the command for that step arrives, and commands are sent on a steady clock.
So it is real time for whoever drives or watches, each command belongs to exactly one world state, and the same commands
give the same worlds again, bit for bit. A simulator with its own clock would use whichever command came last, which could
not be known afterwards.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict
from pathlib import Path
from time import monotonic
from types import TracebackType

import yaml
from fbql_common.core.errors import BadInput
from fbql_common.core.topic_names import RESET_EPISODE, WHEEL_COMMAND, WORLD
from fbql_common.core.types import WheelCommand, World
from fbql_common.files import write_atomically
from fbql_common.inputs import Input
from fbql_common.qos import STEP_QOS
from fbql_common.spin import how_ended
from fbql_common.wire import decode_world, encode_command
from fbql_msgs.msg import WheelCommand as WheelCommandMsg
from fbql_msgs.srv import ResetEpisode
from fbql_sim.core.parameters import SimulationParameters
from rclpy.task import Future

from fbql.cli.interrupts import Interrupts
from fbql.graph.launch import executable
from fbql.graph.observer import CommandNode
from fbql.graph.processes import start, stop

SIMULATOR = "simulator"
PATIENCE_S = 20.0
"""How long the simulator may take to come up, and to answer [s]."""


class LiveSimulator:
    """A simulator that runs between `with` and its end, and the node that drives it.

    `with` raises BadInput when another simulator runs in the domain, or this one can't be started.

    Args:
        parameters: of the world.
        domain_id: of the graph.
        shared: whether the domain may contain other users' nodes.
        environment: of the simulator's process.
        log_directory: for the simulator's output and its parameter file.
        deliver: called with every world state; one comes again when no command follows.
        interrupts: a signal ends the search for another simulator.
    """

    def __init__(
        self,
        parameters: SimulationParameters,
        domain_id: int,
        shared: bool,
        environment: Mapping[str, str],
        log_directory: Path,
        deliver: Callable[[World], None],
        interrupts: Interrupts,
    ) -> None:
        file = log_directory / "parameters.yaml"
        write_atomically(file, yaml.safe_dump({f"/{SIMULATOR}": {"ros__parameters": asdict(parameters)}}).encode())
        self._command = [executable("fbql_sim", SIMULATOR), "--ros-args", "--params-file", str(file)]
        self._environment = {**environment, "ROS_DOMAIN_ID": str(domain_id)}
        self._log_directory = log_directory
        self._domain_id = domain_id
        self._shared = shared
        self._deliver = deliver
        self._interrupts = interrupts
        self._reset: Future | None = None
        self._reset_s = float("inf")
        self._refusal: str | None = None

    def __enter__(self) -> LiveSimulator:
        self._instructor = CommandNode("instructor", self._domain_id)
        self.look = self._instructor.look
        node = self._instructor.node
        self._commands = node.create_publisher(WheelCommandMsg, WHEEL_COMMAND, STEP_QOS)
        self._input = Input(node, World, WORLD, decode_world, lambda world, _: self._deliver(world), STEP_QOS)
        self._client = node.create_client(ResetEpisode, RESET_EPISODE)
        if self._shared:
            self._refuse_twin()
        try:
            self._process = start(SIMULATOR, self._command, self._environment, self._log_directory)
        except OSError as error:
            self._instructor.close()
            raise BadInput(f"the simulator cannot be started: {self._command[0]}: {error.strerror}") from None
        self._started_s = monotonic()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        stop([self._process])
        self._instructor.close()

    @property
    def ready(self) -> bool:
        """Whether everything is connected."""
        return (
            self._client.service_is_ready()
            and self._commands.get_subscription_count() > 0
            and self._input.publishers() > 0
        )

    def begin(self, episode: int, seed: int) -> None:
        """Asks for an episode, whose world states are then delivered."""
        self._reset = self._client.call_async(ResetEpisode.Request(episode=int(episode), seed=int(seed)))
        self._reset.add_done_callback(self._on_answer)
        self._reset_s = monotonic()

    def send(self, command: WheelCommand) -> None:
        """Sends a command; the world then steps."""
        self._commands.publish(encode_command(command))

    def problem(self) -> str | None:
        """What is wrong; None while all is well."""
        code = self._process.exit_code
        if code is not None:
            return f"the simulator {how_ended(code)}; its output:\n{self._process.tail()}"
        if self._refusal is not None:
            return f"the simulator refused to begin an episode: {self._refusal}"
        if not self.ready and monotonic() - self._started_s > PATIENCE_S:
            return f"after {PATIENCE_S:g} s the simulator is not connected; its output:\n{self._process.tail()}"
        if self._reset is not None and not self._reset.done() and monotonic() - self._reset_s > PATIENCE_S:
            return f"the simulator did not answer within {PATIENCE_S:g} s; its output:\n{self._process.tail()}"
        return None

    def _refuse_twin(self) -> None:
        """Two simulators in one graph would both step. Raises BadInput."""
        node = self._instructor.node
        if self._instructor.discover(
            lambda: self._input.publishers() > 0 or SIMULATOR in node.get_node_names(), self._interrupts
        ):
            self._instructor.close()
            raise BadInput(
                f"a simulator is already running in ROS_DOMAIN_ID={self._domain_id}; "
                "end it, or unset ROS_DOMAIN_ID to get a free domain"
            )

    def _on_answer(self, answer: Future) -> None:
        response = answer.result()
        if response is not None and not response.success:
            self._refusal = response.message
