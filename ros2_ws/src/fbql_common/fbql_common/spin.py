"""Starts nodes, spins them and ends them: the one place that touches signals, the executor and exit codes."""

from __future__ import annotations

import os
import signal
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from types import FrameType

import rclpy
from rclpy._rclpy_pybind11 import RCLError
from rclpy.exceptions import ROSInterruptException
from rclpy.executors import ExternalShutdownException
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.task import Future

from fbql_common.core.errors import BadInput

DONE, FAILED, BAD_INPUT = 0, 1, 2
_PATIENCE_S = 0.2
"""How long the executor waits before it looks at signals. Its endless spin() is deaf to them (these wheels)."""


class GraphNode(Node):
    """A node that can say that its work is done.

    `finish(code)` ends the process (or, in one process, all its nodes) with that exit code.
    """

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self.finished: Future = Future()

    def finish(self, code: int = DONE) -> None:
        """Ends the spinning with an exit code. The first call counts."""
        if not self.finished.done():
            self.finished.set_result(code)

    def close(self) -> None:
        """Called once when the spinning has ended, however it ended, while the context may be shut down already."""


def spin(make_nodes: Sequence[Callable[[], GraphNode]], args: Sequence[str] | None = None) -> int:
    """Makes the nodes, spins them in one executor until one finishes or a signal comes, and closes them.

    Returns:
        0 when the work is done or SIGINT, SIGTERM or SIGHUP came, 1 when a node failed, 2 on bad input.
    """
    try:
        _refuse_security()
        _writable_log_directory()
        rclpy.init(args=list(sys.argv if args is None else args))
    except BadInput as error:
        return _say(error, BAD_INPUT)
    except (RCLError, ValueError, rclpy.exceptions.InvalidNodeNameException) as error:
        return _say(_first_line(error), BAD_INPUT)
    signal.signal(signal.SIGHUP, _shutdown)
    nodes: list[GraphNode] = []
    code = DONE
    try:
        executor = EventsExecutor()
        for make in make_nodes:
            node = make()
            nodes.append(node)
            executor.add_node(node)
        code = _spin(executor, nodes)
    except BadInput as error:
        code = _say(error, BAD_INPUT)
    except (KeyboardInterrupt, ExternalShutdownException, ROSInterruptException):
        pass
    except RCLError:
        if rclpy.ok():
            raise
    finally:
        # A second signal must not cut the closing short: a recording is being finished.
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, signal.SIG_IGN)
        codes = [_close(node) for node in nodes]
        rclpy.try_shutdown()
    return code or max(codes, default=DONE)


def _spin(executor: EventsExecutor, nodes: Sequence[GraphNode]) -> int:
    ended: Future = Future()
    for node in nodes:
        node.finished.add_done_callback(lambda done: ended.done() or ended.set_result(done.result()))
        if node.finished.done() and not ended.done():
            ended.set_result(node.finished.result())
    while rclpy.ok() and not ended.done():
        executor.spin_until_future_complete(ended, timeout_sec=_PATIENCE_S)
    return ended.result() if ended.done() else DONE


def _close(node: GraphNode) -> int:
    node.close()
    return node.finished.result() if node.finished.done() else DONE


def _shutdown(_number: int, _frame: FrameType | None) -> None:
    rclpy.try_shutdown()


def _refuse_security() -> None:
    if os.environ.get("ROS_SECURITY_ENABLE", "").lower() == "true":
        raise BadInput(
            "ROS_SECURITY_ENABLE is true, but this Fast DDS is built without DDS-Security and would run unsecured; "
            "unset it, or use a ROS 2 with SROS2"
        )


def _writable_log_directory() -> None:
    """Points ROS_LOG_DIR to a directory that can be written, when the one in force can't be."""
    home = Path(os.environ.get("ROS_HOME") or Path(os.environ.get("HOME") or "/") / ".ros")
    directory = Path(os.environ.get("ROS_LOG_DIR") or home / "log")
    try:
        directory.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=directory):
            return
    except OSError as error:
        try:
            os.environ["ROS_LOG_DIR"] = tempfile.mkdtemp(prefix="fbql-log-")
        except OSError:
            raise BadInput(
                f"no log can be written, neither to {directory} ({error.strerror}) nor to {tempfile.gettempdir()}; "
                "set ROS_LOG_DIR to a directory that can be written"
            ) from None
        print(f"log directory {directory}: {error.strerror}; using {os.environ['ROS_LOG_DIR']}", file=sys.stderr)


def _first_line(error: Exception) -> str:
    return str(error).strip().splitlines()[0] if str(error).strip() else type(error).__name__


def _say(message: object, code: int) -> int:
    print(message, file=sys.stderr)
    return code
