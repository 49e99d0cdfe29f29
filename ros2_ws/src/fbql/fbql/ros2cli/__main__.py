"""`python -m fbql.ros2cli topic|node|param VERB ...`, which `scripts/ros2` starts."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from errno import ENOSPC, EPIPE
from typing import NoReturn

from fbql_common.core.errors import BadInput
from fbql_common.core.text import one_line
from fbql_common.middleware import prepare_node, set_aside_absent_middleware
from fbql_common.start import stdout_failed

BAD_INPUT, FAILED, DONE, INTERRUPTED = 2, 1, 0, 130


def main(argv: Sequence[str]) -> int:
    """Does what `ros2 ARGV` does. Returns the exit code."""
    try:
        set_aside_absent_middleware(_say)  # before rclpy is imported, which it would end
        arguments = _parse(argv)
        prepare_node(_say)
        return _work(arguments.work, arguments)
    except BadInput as error:
        _say(f"ros2: {error}")
        return BAD_INPUT
    except KeyboardInterrupt:
        return INTERRUPTED
    except OSError as error:
        if error.errno not in (EPIPE, ENOSPC):
            raise
        return stdout_failed(error)


def _work(work: Callable[..., None], arguments: argparse.Namespace) -> int:
    from fbql.ros2cli.graph import Absent, looking_node

    try:
        with looking_node() as node:
            work(node, arguments)
        sys.stdout.flush()
    except Absent as error:
        for line in error.args:
            _say(line)
        return FAILED
    return DONE


class _Parser(argparse.ArgumentParser):
    """Reports a usage error in printable lines."""

    def error(self, message: str) -> NoReturn:
        self.print_usage(sys.stderr)
        self.exit(BAD_INPUT, f"{self.prog}: error: {one_line(message)}\n")


def _parse(argv: Sequence[str]) -> argparse.Namespace:
    """Raises BadInput for a verb that only a real ros2 has."""
    from fbql.ros2cli import node, param, topic

    parser = _Parser(prog="ros2", description="The part of ros2 that looks at a graph.")
    groups = parser.add_subparsers(metavar="{topic,node,param}", required=True)
    for name, module in (("topic", topic), ("node", node), ("param", param)):
        if len(argv) > 1 and argv[0] == name and not argv[1].startswith("-") and argv[1] not in module.VERBS:
            raise BadInput(
                f"'ros2 {name} {argv[1]}' needs a real ros2 (an installed ROS 2 Jazzy); here are: {', '.join(module.VERBS)}"
            )
        group = groups.add_parser(name, help=f"Various {name} related sub-commands")
        module.add_verbs(group.add_subparsers(metavar=f"{{{','.join(module.VERBS)}}}", required=True))
    return parser.parse_args(list(argv))


def _say(text: object) -> None:
    print(one_line(text), file=sys.stderr)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
