"""Starts, spins and closes nodes; handles signals, the executor and exit codes for all of them."""

from __future__ import annotations

import os
import signal
import sys
import tempfile
from collections.abc import Callable, Sequence
from errno import ENOENT
from itertools import pairwise
from pathlib import Path
from time import monotonic
from types import FrameType
from typing import Any

import rclpy
from rclpy._rclpy_pybind11 import RCLError, UnknownROSArgsError
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.exceptions import InvalidParameterTypeException, NameValidationException
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future
from rclpy.utilities import remove_ros_args

from fbql_common.core.errors import BadInput
from fbql_common.core.text import one_line
from fbql_common.files import unreadable
from fbql_common.middleware import prepare_node

DONE, FAILED, BAD_INPUT = 0, 1, 2
SUPERVISED = "FBQL_SUPERVISED"
"""Environment variable that a supervisor sets for the processes it starts: one that a signal ends then returns 128 plus the
signal's number, as a shell reports it, instead of 0, so that the supervisor can tell which node was ended by which signal."""
_SIGNAL_BASE = 128
_SETTLE_S = 1.0
"""How long a node that is started by itself looks for others of its kind [s]. A supervisor sees to it that there are none."""
_PATIENCE_S = 0.2
"""How often the executor checks for signals [s]. Its spin() without a timeout never does (in these wheels)."""


class GraphNode(Node):
    """A node that can end its process.

    `finish(code)` ends the process, with all its nodes, with that exit code. `options` are those of rclpy's Node
    (namespace, context, cli_args ...), for callers that compose nodes.
    """

    def __init__(self, name: str, **options: Any) -> None:
        super().__init__(name, **options)
        self.finished: Future = Future()
        self._settles_s = float("-inf")

    def finish(self, code: int = DONE) -> None:
        """Ends the spinning with an exit code; only the first call counts."""
        if not self.finished.done():
            self.finished.set_result(code)

    def settle(self, duration_s: float) -> None:
        """Lets the node look for others of its kind for this long before it takes part."""
        self._settles_s = monotonic() + duration_s

    @property
    def is_settled(self) -> bool:
        """Whether that time is over."""
        return monotonic() >= self._settles_s

    def close(self) -> None:
        """Called once when the spinning has ended, for any reason; publishing still works."""


class _Signals:
    """Records SIGINT, SIGTERM and SIGHUP; the context stays valid until the nodes are closed.

    rclpy's own handlers shut the context down in the middle of a callback. These only set a flag, so that the current
    callback completes and close() can still publish. Further signals are ignored while a recording is being finished.
    """

    def __init__(self) -> None:
        self.received = 0
        """The first signal that arrived; 0 before."""
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, self._note)

    def _note(self, number: int, _frame: FrameType | None) -> None:
        self.received = self.received or number


def spin(make_nodes: Sequence[Callable[[], GraphNode]], args: Sequence[str] | None = None) -> int:
    """Makes the nodes, spins them in one executor until one finishes or a signal arrives, and closes them.

    Returns:
        0 when the work is done, 2 on bad input, else the code that a node finished with. When a signal arrived first: 0,
        or 128 plus its number under a supervisor (see SUPERVISED).
    """
    signals = _Signals()
    words = list(sys.argv if args is None else args)
    try:
        prepare_node(_say)
        _ensure_log_directory()
        _require_parameter_files(words)
        rclpy.init(args=words, signal_handler_options=SignalHandlerOptions.NO)
    except BadInput as error:
        return _fail(error)
    except UnknownROSArgsError as error:
        return _fail(f"unknown ROS arguments: {error}")
    except RCLError as error:
        return _fail(str(error).strip().partition("\n")[0])
    nodes: list[GraphNode] = []
    try:
        _refuse_other_arguments(words)
        executor = EventsExecutor()
        for make in make_nodes:
            node = make()
            if not os.environ.get(SUPERVISED):
                node.settle(_SETTLE_S)
            nodes.append(node)
            executor.add_node(node)
        return _spin(executor, nodes, signals)
    except (BadInput, InvalidParameterTypeException) as error:
        return _fail(error)
    except NameValidationException as error:
        return _fail(" ".join(str(error).rstrip("^ \n").split()))
    except RCLError as error:  # such as a variable of the environment that the middleware can't use
        return _fail(str(error).strip().partition("\n")[0])
    finally:
        rclpy.try_shutdown()


def _require_parameter_files(words: Sequence[str]) -> None:
    """Raises BadInput for a parameter file that is not there: rcl's own message has the place in its source instead."""
    for option, name in pairwise(words):
        if option == "--params-file":
            try:
                Path(name).stat()
            except OSError as error:
                raise unreadable(Path(name), error) from None


def _spin(executor: EventsExecutor, nodes: Sequence[GraphNode], signals: _Signals) -> int:
    ended: Future = Future()

    def end() -> None:
        if not ended.done():
            ended.set_result(None)

    for node in nodes:
        node.finished.add_done_callback(lambda _: end())
    # A busy executor (nodes of one process in lockstep) never reaches its timeout.
    clock = Clock(clock_type=ClockType.STEADY_TIME)
    nodes[0].create_timer(_PATIENCE_S, lambda: end() if signals.received else None, clock=clock)
    try:
        while not (signals.received or ended.done()):
            executor.spin_until_future_complete(ended, timeout_sec=_PATIENCE_S)
    finally:
        for node in nodes:
            node.close()
    on_signal = _SIGNAL_BASE + signals.received if signals.received and os.environ.get(SUPERVISED) else DONE
    return max((node.finished.result() for node in nodes if node.finished.done()), default=on_signal)


def how_ended(code: int) -> str:
    """How a supervised process ended, in words, from its exit code as `subprocess` gives it."""
    number = -code if code < 0 else code - _SIGNAL_BASE
    if not 0 < number < signal.NSIG:
        return f"ended with exit code {code}"
    try:
        return f"was ended by {signal.Signals(number).name}"
    except ValueError:  # a real-time signal between the first and the last, which alone have names
        return f"was ended by signal {number}"


def _refuse_other_arguments(words: Sequence[str]) -> None:
    """Raises BadInput for arguments outside --ros-args, such as a parameter, which would be ignored silently."""
    unknown = remove_ros_args(words)[1:]
    if unknown:
        raise BadInput(
            f"{Path(words[0]).name}: unknown arguments: {' '.join(unknown)}; parameters and remappings are given as "
            "--ros-args -p NAME:=VALUE -r FROM:=TO; docs/parameters.md has their names, and those of an example are in its file"
        )


def _ensure_log_directory() -> None:
    """Points ROS_LOG_DIR to a writable directory when the current log directory is not."""
    directory = _log_directory()
    try:
        if directory is None:
            raise FileNotFoundError(ENOENT, "HOME is not set")
        directory.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=directory):
            return
    except OSError as error:
        where = directory or "~/.ros/log"
        try:
            os.environ["ROS_LOG_DIR"] = tempfile.mkdtemp(prefix="fbql-log-")
        except OSError:
            raise BadInput(
                f"no log can be written, neither to {where} ({error.strerror}) nor to {tempfile.gettempdir()}; "
                "set ROS_LOG_DIR to a directory that can be written"
            ) from None
        print(one_line(f"log directory {where}: {error.strerror}; using {os.environ['ROS_LOG_DIR']}"), file=sys.stderr)


def _log_directory() -> Path | None:
    """The directory that ROS will log to, by its own rules; None where they give none."""
    if named := os.environ.get("ROS_LOG_DIR"):
        return Path(named)
    if home := os.environ.get("ROS_HOME"):
        return Path(home) / "log"
    return Path(home) / ".ros" / "log" if (home := os.environ.get("HOME")) else None


def _say(text: str) -> None:
    print(one_line(text), file=sys.stderr)


def _fail(message: object) -> int:
    print(one_line(message), file=sys.stderr)
    return BAD_INPUT
