"""The node of a command that looks at a graph."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Generator
from contextlib import contextmanager
from time import monotonic
from typing import Any

import rclpy
from fbql_common.core.errors import BadInput
from fbql_common.core.text import as_lines, encodable
from fbql_common.message_types import message_class
from rclpy._rclpy_pybind11 import RCLError
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

PATIENCE_S = 10.0
"""How long something may take to show up [s]."""
_QUIET_S = 3.1
"""The graph counts as seen when nothing new has shown up for this long [s]: participants announce themselves every 3 s."""
_LOOK_S = 0.05


class Absent(Exception):
    """Something that was asked for is not there; the text is what ros2 prints in that case."""


def add_graph_options(parser: argparse.ArgumentParser) -> None:
    """Adds the options that every command has."""
    parser.add_argument("--no-daemon", action="store_true", help="Accepted for compatibility: there is no daemon here")
    parser.add_argument(
        "--spin-time",
        type=float,
        default=PATIENCE_S,
        metavar="SPIN_TIME",
        help=f"Longest time in seconds to wait for discovery ({PATIENCE_S:g})",
    )


@contextmanager
def looking_node() -> Generator[Node]:
    """A hidden node that takes no part in the graph. Raises BadInput for an environment that ROS can't use."""
    try:
        rclpy.init(args=["--ros-args", "--disable-external-lib-logs"], signal_handler_options=SignalHandlerOptions.NO)
    except RCLError as error:
        raise BadInput(str(error).strip().partition("\n")[0]) from None
    try:
        yield Node(
            f"_ros2cli_{os.getpid()}", use_global_arguments=False, enable_rosout=False, start_parameter_services=False
        )
    finally:
        rclpy.try_shutdown()


def show(text: object) -> None:
    """Prints what others say, in its lines: with everything escaped that is not printable, or that stdout can't encode."""
    print(encodable(as_lines(str(text).split("\n")), sys.stdout.encoding), flush=True)


def until(node: Node, condition: Callable[[], object], patience_s: float) -> bool:
    """Waits until a condition holds, at most this long [s]. Returns whether it does."""
    deadline = monotonic() + patience_s
    while not condition():
        if monotonic() > deadline:
            return False
        rclpy.spin_once(node, timeout_sec=_LOOK_S)
    return True


def settle(node: Node, seen: Callable[[], Any], patience_s: float) -> None:
    """Waits until something of the graph is seen and has stopped changing, at most this long [s]."""
    deadline = monotonic() + patience_s
    last, changed_s = seen(), monotonic()
    while (now := monotonic()) < deadline and (not last or now - changed_s < _QUIET_S):
        rclpy.spin_once(node, timeout_sec=_LOOK_S)
        if (latest := seen()) != last:
            last, changed_s = latest, now


def absolute(name: str) -> str:
    """A name as it is in the root namespace."""
    return name if name.startswith("/") else f"/{name}"


def is_hidden(name: str) -> bool:
    """Whether a part of a name begins with an underscore."""
    return any(part.startswith("_") for part in name.split("/"))


def class_of(type_name: str) -> type[Any]:
    """The class of a message type such as `std_msgs/msg/Bool`. Raises Absent where it is not installed."""
    found = message_class(type_name)
    if found is None:
        raise Absent(f"The message type '{type_name}' is invalid")
    return found
