"""The `fbql` program: finds a command, runs it, and turns whatever ends it early into one line and an exit code.

A command is a module with two functions:

    parser(program: str) -> Parser                              its command line
    run(arguments: Namespace, interrupts: Interrupts) -> int    does the work, returns the exit code

It raises `BadInput` for input that it refuses, `Interrupted` where a signal ended it before there was a result, and
`Unwritable` for an output file that can't be written. Another package adds a command by an entry point of the group
`fbql.commands` that names such a module.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from errno import EIO
from importlib import import_module
from importlib.metadata import entry_points, version
from pathlib import Path
from typing import Any, NamedTuple

from fbql_common.core.errors import BadInput
from fbql_common.files import DISK_FAILURES

from fbql.cli.exit_codes import BAD_INPUT, DONE, FAILED, INTERRUPTED
from fbql.cli.interrupts import Interrupted, Interrupts
from fbql.cli.missing import what_is_missing
from fbql.cli.output import Unwritable, complain, print_result, results_apart, set_program
from fbql.cli.places import type_commands_as

GROUP = "fbql.commands"


class Command(NamedTuple):
    """A built-in command."""

    summary: str
    handles_signals: bool = True
    """Whether it finishes cleanly on a signal, with what it has; otherwise Ctrl-C ends it at once."""


COMMANDS = {
    "bringup": Command("start the node graph, play, record and print the result"),
    "train": Command("play the same match without ROS, in one process"),
    "demonstrate": Command(
        "record demonstrations of a behavior, by its instructor or by keyboard", handles_signals=False
    ),
    "induce": Command("make a decision tree from demonstrations", handles_signals=False),
    "tree": Command("explain, export, check, change or import a tree file", handles_signals=False),
    "tune": Command("tune the leaves of a tree by Q-learning", handles_signals=False),
    "make_trees": Command("regenerate the shipped trees from their seeds", handles_signals=False),
    "replay": Command("replay a recording, verify it, or answer what-if questions"),
    "recover": Command("repair a damaged recording"),
    "report": Command("write a page that explains a recording step by step"),
    "compare": Command("compare recordings side by side"),
    "lesson": Command("show a lesson of the course, or check an answer", handles_signals=False),
}


def main(argv: Sequence[str] | None = None) -> int:
    """`fbql COMMAND ...`. Returns the exit code."""
    words = sys.argv[1:] if argv is None else list(argv)
    if not words:
        complain(f"name a COMMAND, one of: {', '.join(names())} (see --help)")
        return BAD_INPUT
    if words[0] in ("-h", "--help"):
        print_result(_usage())
        return DONE
    if words[0] == "--version":
        print_result(version("fbql"))
        return DONE
    return run(words[0], words[1:])


def executable() -> int:
    """Runs the command that this program is named after: `ros2 run fbql NAME`."""
    name = Path(sys.argv[0]).name
    type_commands_as("ros2 run fbql {}")
    return run(name, sys.argv[1:], name)


def run(name: str, argv: Sequence[str], program: str = "") -> int:
    """Runs a command. Returns the exit code.

    Args:
        program: the name it uses for itself; "fbql NAME" unless given.
    """
    program = program or f"fbql {name}"
    set_program(program)
    interrupts = Interrupts()
    if name not in COMMANDS or COMMANDS[name].handles_signals:
        interrupts.install()  # before all else: importing takes a second, in which a signal would end in a traceback

    def work() -> int:
        interrupts.let_in()
        if os.environ.get("RMW_IMPLEMENTATION"):
            _check_middleware()
        command = _find(name)
        return command.run(command.parser(program).parse_args(list(argv)), interrupts)

    with results_apart() if name in COMMANDS else nullcontext():
        return reporting(work)


def reporting(work: Callable[[], int]) -> int:
    """The exit code of `work`; whatever ends it early is reported in one line."""
    try:
        return work()
    except BadInput as error:
        complain(error)
        return BAD_INPUT
    except Unwritable as error:
        complain(error)
        return error.exit_code
    except OSError as error:
        # A file that nothing else expected to fail: the system says which and why.
        if error.filename is None and error.errno not in DISK_FAILURES:
            raise
        name = os.fsdecode(error.filename or "a file")
        is_full = error.errno in DISK_FAILURES and error.errno != EIO  # with EIO, reading may have failed
        complain(Unwritable(name, error) if is_full else f"{name}: {error.strerror}")
        return FAILED if error.errno in DISK_FAILURES else BAD_INPUT
    except Interrupted as error:
        complain(error)
        return FAILED
    except KeyboardInterrupt:
        complain("interrupted")
        return INTERRUPTED
    except ModuleNotFoundError as error:
        missing = what_is_missing(error.name or "")
        if missing is None:
            raise
        complain(missing)
        return BAD_INPUT


def names() -> list[str]:
    """Every command, including those of other packages."""
    return list(dict.fromkeys((*COMMANDS, *(each.name for each in entry_points(group=GROUP)))))


def _find(name: str) -> Any:
    """The module of a command. Raises BadInput for an unknown one."""
    if name in COMMANDS:
        return import_module(f"fbql.commands.{name}")
    for each in entry_points(group=GROUP, name=name):
        return each.load()
    raise BadInput(f"there is no command '{name}'; choose one of: {', '.join(names())}")


def _check_middleware() -> None:
    """To be called before a command imports rclpy, which ends the process if the user's middleware is not installed."""
    try:
        from fbql_common.middleware import set_aside_absent_middleware
    except ModuleNotFoundError:  # no ROS here, and a command that needs it says so
        return
    set_aside_absent_middleware(complain)


def _summary(name: str) -> str:
    """One line about a command; for one of another package, the first sentence of its docstring, in our style."""
    if name in COMMANDS:
        return COMMANDS[name].summary
    sentence = (_find(name).__doc__ or "").partition("\n")[0].partition(". ")[0].removesuffix(".")
    return sentence[:1].lower() + sentence[1:]


def _usage() -> str:
    lines = [f"  {name:<12} {_summary(name)}" for name in names()]
    return "\n".join(("usage: fbql COMMAND ...", "", *lines, "", "fbql COMMAND --help shows a command's options."))
