"""The robot in its rooms as a node: /scan, /odom, /goal and /clock out, /cmd_vel in.

Lockstep. A step begins with the sensors. When every source has answered, `outcome` says what was achieved, if anything, and /clock
moves on by one period, at which the mux decides (`fusion/decision`) and the command of the source that it chose arrives on `cmd_vel`.
What is lost on the way is sent again, so nothing depends on the speed of the machine.

Owns: the rooms, the clock, the trails. Does not own: who drives.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from fbql.cli.words import counted
from fbql_common.core.mux_types import MuxDecision, RobotOutcome
from fbql_common.core.parameters import parameter
from fbql_common.core.topic_names import CLOCK, CMD_VEL, DECISION, OUTCOME
from fbql_common.core.twist import Twist
from fbql_common.declare import declare_parameters
from fbql_common.inputs import Input
from fbql_common.qos import COMMAND_QOS, STEP_QOS
from fbql_common.spin import FAILED, GraphNode
from fbql_common.watch import steady_timer
from fbql_common.wire import MESSAGES, decode_mux_decision, decode_twist, encode_outcome
from fbql_studies.rooms.learned import PENALTY, REWARD
from fbql_studies.rooms.maps import FAMILIES, room_of
from fbql_studies.rooms.play import COLLISION, SUCCESS, End, end_of, outcome_of
from fbql_studies.rooms.robot import PERIOD_S, Reading
from fbql_studies.rooms.worlds import IrSimWorld, TwinWorld
from geometry_msgs.msg import Vector3Stamped
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import LaserScan
from sensors import goal_at, odometry_of, scan_of

WORLDS = {"irsim": IrSimWorld, "twin": TwinWorld}
TRAIL_HEAD = "family,room,step,x_m,y_m,driver\n"
_PERIOD_NS = round(PERIOD_S * 1e9)
_LOOK_S = 1.0
"""A step that has taken this long is sent again."""
_PATIENCE = 30
"""How often in a row it is sent again."""
_SAY_EVERY = 20
"""Rooms between two lines about the progress."""


@dataclass(frozen=True)
class BridgeParameters:
    """Parameters of the bridge."""

    family: str = parameter("traps", "family of rooms", choices=list(FAMILIES))
    first_room: int = parameter(0, "seed of the first room; each episode has the next one", low=0, high=2**31)
    episodes: int = parameter(10, "episodes", low=1)
    world: str = parameter("irsim", "the simulator: IR-SIM, or its faster twin", choices=list(WORLDS))
    noise_m: float = parameter(0.0, "standard deviation of the scan's noise", unit="m", low=0.0, high=1.0)
    trails: str = parameter("", "file for the trails (CSV), in an existing directory; empty: none are kept")


class Bridge(GraphNode):
    """One robot, one room after another."""

    def __init__(self, sources: Sequence[str], **options) -> None:
        super().__init__("rooms", **options)
        self._parameters = declare_parameters(self, BridgeParameters)
        self._world = WORLDS[self._parameters.world](self._parameters.noise_m)
        self._scan_publisher = self.create_publisher(LaserScan, "scan", STEP_QOS)
        self._odometry_publisher = self.create_publisher(Odometry, "odom", STEP_QOS)
        self._goal_publisher = self.create_publisher(Vector3Stamped, "goal", STEP_QOS)
        self._clock_publisher = self.create_publisher(Clock, CLOCK, STEP_QOS)
        self._outcome_publisher = self.create_publisher(MESSAGES[RobotOutcome], OUTCOME, STEP_QOS)
        self._sources = tuple(sources)
        for name in self._sources:
            self.create_subscription(
                MESSAGES[Twist], f"{name}_vel", lambda _, name=name: self._on_source(name), COMMAND_QOS, raw=True
            )
        self._commands = Input(self, Twist, CMD_VEL, decode_twist, self._on_command, COMMAND_QOS)
        self._decisions = Input(self, MuxDecision, DECISION, decode_mux_decision, self._on_decision, STEP_QOS)
        # The mux decides at every full period: between two of them the clock is moved on from one half to the next.
        self._now_ns = _PERIOD_NS // 2
        self._reading: Reading | None = None
        self._heard: set[str] = set()
        """The sources that have answered this step."""
        self._command = Twist()
        self._decision: MuxDecision | None = None
        self._trail: list[str] = []
        self.ends: list[End] = []
        self._looked_at: tuple[int, int] | None = None
        self._looks = 0
        self._look_timer = steady_timer(self, _LOOK_S, self._look)
        self._start_timer = steady_timer(self, 0.1, self._start)

    # The beginning, and what is lost

    def _missing(self) -> list[str]:
        """Those that are not connected yet."""
        found = {f"the source {name}": self.count_publishers(f"{name}_vel") > 0 for name in self._sources}
        found["a listener of scan"] = self._scan_publisher.get_subscription_count() > len(self._sources)
        found["the mux"] = self.count_publishers(DECISION) > 0 and self._outcome_publisher.get_subscription_count() > 0
        return [what for what, is_there in found.items() if not is_there]

    def _start(self) -> None:
        if not self._missing():
            self._start_timer.cancel()
            self._publish_clock()
            self._begin()

    def _look(self) -> None:
        """Sends again what this step needs, if it has not moved since the last look, and gives up in the end."""
        now = (len(self.ends), self._now_ns)
        self._looks = self._looks + 1 if now == self._looked_at else 0
        self._looked_at = now
        waiting = [name for name in self._sources if name not in self._heard]
        if self._looks > _PATIENCE:
            absent = self._missing() or [*(f"an answer of {name}" for name in waiting), "a decision of the mux"]
            self.get_logger().error(f"waited {_PATIENCE} s for {absent[0]}")
            self.finish(FAILED)
        elif self._looks and self._reading is not None:
            self._publish_sensors(self._reading) if waiting else self._publish_clock()

    # One step: sensors, sources, outcome, clock, decision, command

    def _begin(self) -> None:
        self._room = room_of(self._parameters.family, self._parameters.first_room + len(self.ends))
        self._sense(self._world.reset(self._room))

    def _sense(self, reading: Reading) -> None:
        self._reading = reading
        self._heard.clear()
        self._publish_sensors(reading)

    def _publish_sensors(self, reading: Reading) -> None:
        self._goal_publisher.publish(goal_at(reading.goal_distance_m, reading.goal_bearing_rad, self._now_ns))
        self._odometry_publisher.publish(odometry_of(reading, self._now_ns))
        self._scan_publisher.publish(scan_of(reading, self._now_ns))

    def _publish_clock(self) -> None:
        clock = Clock()
        clock.clock.sec, clock.clock.nanosec = divmod(self._now_ns, 10**9)
        self._clock_publisher.publish(clock)

    def _on_source(self, name: str) -> None:
        reading = self._reading
        if reading is None or name in self._heard:
            return
        self._heard.add(name)
        if len(self._heard) < len(self._sources):
            return
        if reading.terminated or reading.truncated:
            reward = (PENALTY if reading.collided else REWARD) if reading.terminated else 0.0
            outcome = outcome_of(reading) if reading.terminated else ""
            told = RobotOutcome(self._now_ns, reward, reading.terminated, reading.truncated, outcome)
            self._outcome_publisher.publish(encode_outcome(told))
        self._now_ns += _PERIOD_NS
        self._publish_clock()

    def _on_decision(self, decision: MuxDecision, _data: bytes) -> None:
        self._decision = decision
        self._drive_on()

    def _on_command(self, command: Twist, _data: bytes) -> None:
        self._command = command
        self._drive_on()

    def _drive_on(self) -> None:
        """Drives on when decision and command of this moment are there, in whatever order they came."""
        decision, reading = self._decision, self._reading
        if decision is None or reading is None:
            return
        is_over = decision.terminated or decision.truncated
        command = (self._command.linear_x_m_s, self._command.angular_z_rad_s)
        if decision.driver >= 0 and not is_over and command != decision.command:
            return
        self._decision = None
        driver = decision.behaviors[decision.driver] if decision.driver >= 0 else ""
        self._trail.append(
            f"{self._room.family},{self._room.seed},{reading.step},{reading.x_m!r},{reading.y_m!r},{driver}\n"
        )
        if is_over:
            self._end(reading)
        else:
            self._sense(self._world.step(*decision.command))

    def _end(self, reading: Reading) -> None:
        self.ends.append(end_of(self._room, reading))
        self._write_trail()
        if len(self.ends) < self._parameters.episodes:
            if len(self.ends) % _SAY_EVERY == 0:
                self.get_logger().info(f"room {len(self.ends)}; the last {self._told(self.ends[-_SAY_EVERY:])}")
            self._begin()
        else:
            self.finish()

    def _write_trail(self) -> None:
        if self._parameters.trails:
            path = Path(self._parameters.trails)
            head = "" if path.exists() else TRAIL_HEAD
            with path.open("a") as file:
                file.write(head + "".join(self._trail))
        self._trail.clear()

    def _told(self, ends: Sequence[End]) -> str:
        outcomes = [end.outcome for end in ends]
        reached, collided = outcomes.count(SUCCESS), outcomes.count(COLLISION)
        return f"{counted(len(ends), 'room')}: {counted(reached, 'goal')} reached, {counted(collided, 'collision')}"

    def close(self) -> None:
        """Reports how it went."""
        self.get_logger().info(self._told(self.ends))
