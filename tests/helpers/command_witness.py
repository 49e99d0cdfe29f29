"""Writes down when each command of a run came: python command_witness.py DOMAIN_ID FILE.

A line for each: nanoseconds of the steady clock, which all processes of a machine share, episode, step. It ends when it
is killed.
"""

from __future__ import annotations

import sys
from functools import partial
from pathlib import Path
from time import monotonic_ns
from typing import TextIO

import rclpy
from fbql_common.core.topic_names import WHEEL_COMMAND
from fbql_common.wire import decode_command
from fbql_msgs.msg import WheelCommand
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy

DEPTH = 10_000
"""Nothing is lost here because this process is slow."""


def main() -> None:
    """Listens."""
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=int(sys.argv[1]))
    node = Node("witness", context=context, use_global_arguments=False, enable_rosout=False)
    qos = QoSProfile(depth=DEPTH, reliability=ReliabilityPolicy.BEST_EFFORT)
    with Path(sys.argv[2]).open("w", buffering=1) as file:
        node.create_subscription(WheelCommand, WHEEL_COMMAND, partial(_note, file), qos, raw=True)
        executor = EventsExecutor(context=context)
        executor.add_node(node)
        while context.ok():
            executor.spin_once(timeout_sec=0.2)


def _note(file: TextIO, data: bytes) -> None:
    now_ns = monotonic_ns()
    command = decode_command(data)
    file.write(f"{now_ns} {command.episode} {command.step}\n")


if __name__ == "__main__":
    main()
