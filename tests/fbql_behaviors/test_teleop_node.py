"""A person at a terminal drives: keys into a pseudo-terminal, commands on a topic, and rest at every end."""

from __future__ import annotations

import os
import signal
import termios
from collections.abc import Callable, Iterator
from time import monotonic

import pytest
from bringup_run import Terminal
from fbql_common.core.topic_names import CMD_VEL
from fbql_common.core.twist import StampedTwist, Twist
from fbql_common.wire import MESSAGES, decode_stamped_twist, decode_twist
from hand_driven import Bench, Partner
from node_process import NodeProcess
from rclpy.qos import QoSProfile

ENVIRONMENT = {"TERM": "xterm-256color", "LC_ALL": "C.UTF-8", "NO_COLOR": "1"}
STEP = Twist(linear_x_m_s=0.05)
LEFT = "\x1b[D"
SILENCE_S = 1.0
"""Many times the period of the commands [s]."""


class Sitting:
    """A terminal with the node at it, and what the node publishes."""

    def __init__(
        self, bench: Bench, start_node: Callable[..., NodeProcess], *parameters: str, stamped: bool = False
    ) -> None:
        self.bench = bench
        self.heard: list[Twist | StampedTwist] = []
        self.heard_s = monotonic()
        """When the last of them came."""
        self._decode = decode_stamped_twist if stamped else decode_twist
        partner = bench.add(Partner)
        partner.create_subscription(
            MESSAGES[StampedTwist if stamped else Twist],
            CMD_VEL,
            self._on_command,
            QoSProfile(depth=1000),
            raw=True,
        )
        self.terminal = Terminal()
        self.before = termios.tcgetattr(self.terminal.descriptor)
        words = [word for each in parameters for word in ("-p", each)]
        self.process = start_node(
            *("fbql_behaviors", "teleop", "--ros-args", "-r", f"__ns:={bench.namespace}", *words),
            terminal=self.terminal.descriptor,
            **ENVIRONMENT,
        )
        self.until_shown("listening: 1")

    def _on_command(self, data: bytes) -> None:
        self.heard.append(self._decode(data))
        self.heard_s = monotonic()

    def until_shown(self, text: str) -> None:
        """Waits until the terminal shows a text."""
        self.bench.until(lambda: text in self.terminal.shown or self.process.popen.poll() is not None, f"'{text}'")
        assert text in self.terminal.shown, self.process.printed()

    def type(self, keys: str) -> None:
        """Types on the keyboard."""
        self.terminal.type(keys.encode())

    def until_heard(self, command: Twist | StampedTwist) -> None:
        """Waits for a command, which is not among those of before."""
        begin = len(self.heard)
        self.bench.until(lambda: command in self.heard[begin:], f"{command}")

    def until_ended(self) -> int:
        """Waits for the end of the process and of its messages."""
        self.bench.until(lambda: self.process.popen.poll() is not None, "the end of the node")
        return self.process.exit_code()


@pytest.fixture
def sit_down(bench: Bench, start_node: Callable[..., NodeProcess]) -> Iterator[Callable[..., Sitting]]:
    """Starts the node at a terminal."""
    made: list[Sitting] = []

    def begin(*parameters: str, **options: bool) -> Sitting:
        made.append(Sitting(bench, start_node, *parameters, **options))
        return made[-1]

    yield begin
    for sitting in made:
        sitting.process.close()
        os.close(sitting.terminal.descriptor)
        sitting.terminal.close()


def test_keys_drive_the_robot_which_rests_after_the_last_one_and_silence_follows(
    sit_down: Callable[..., Sitting],
) -> None:
    sitting = sit_down()
    assert f"{sitting.bench.namespace}/cmd_vel (geometry_msgs/Twist)" in sitting.terminal.shown
    for text in ("faster", "turn left", "space", "quit", "stops 0.7 s after the last key"):
        assert text in sitting.terminal.shown
    assert sitting.heard == [], "nothing goes out before a key"
    sitting.type("ww" + LEFT)
    sitting.until_heard(Twist(linear_x_m_s=0.1, angular_z_rad_s=0.1))
    sitting.until_heard(Twist())
    sitting.bench.until(lambda: monotonic() - sitting.heard_s > SILENCE_S, "silence")
    sitting.type("s")
    sitting.until_heard(Twist(linear_x_m_s=-0.05))


def test_quitting_stops_the_robot_and_leaves_the_terminal_as_it_was(sit_down: Callable[..., Sitting]) -> None:
    sitting = sit_down("release_s:=5.0", "max_linear_m_s:=0.5")
    sitting.type("w")
    sitting.until_heard(STEP)
    sitting.type("q")
    assert sitting.until_ended() == 0
    sitting.bench.until(lambda: sitting.heard[-1] == Twist(), "a zero at the end")
    assert termios.tcgetattr(sitting.terminal.descriptor) == sitting.before


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_stops_the_robot_and_leaves_the_terminal_as_it_was(
    sit_down: Callable[..., Sitting], number: signal.Signals
) -> None:
    sitting = sit_down("release_s:=5.0")
    sitting.type("w")
    sitting.until_heard(STEP)
    sitting.process.send(number)
    assert sitting.until_ended() == 0
    sitting.bench.until(lambda: sitting.heard[-1] == Twist(), "a zero at the end")
    assert termios.tcgetattr(sitting.terminal.descriptor) == sitting.before


def test_ctrl_z_stops_the_robot(sit_down: Callable[..., Sitting]) -> None:
    sitting = sit_down("release_s:=5.0")
    sitting.type("w")
    sitting.until_heard(STEP)
    sitting.process.send(signal.SIGTSTP)
    sitting.until_heard(Twist())
    sitting.process.send(signal.SIGCONT)
    sitting.type("q")
    assert sitting.until_ended() == 0


def test_space_stops_the_robot_at_once(sit_down: Callable[..., Sitting]) -> None:
    sitting = sit_down("release_s:=5.0")
    sitting.type("w")
    sitting.until_heard(STEP)
    sitting.type(" ")
    sitting.until_heard(Twist())


def test_commands_may_be_stamped_and_go_out_while_idle(sit_down: Callable[..., Sitting]) -> None:
    sitting = sit_down("stamped:=true", "frame:=robot", "publish_when_idle:=true", stamped=True)
    sitting.bench.until(lambda: sitting.heard, "a command without a key")
    command = sitting.heard[0]
    assert isinstance(command, StampedTwist)
    assert (command.frame, command.twist) == ("robot", Twist())
    assert command.stamp_ns > 0


def test_without_a_terminal_it_is_refused_in_one_line(start_node: Callable[..., NodeProcess]) -> None:
    process = start_node("fbql_behaviors", "teleop")
    assert process.exit_code() == 2
    assert process.printed().splitlines() == [
        "an interactive terminal is needed: standard input is not one; start it in a terminal"
    ]
