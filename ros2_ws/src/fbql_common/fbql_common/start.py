"""Starts a node's program, with the checks that must come before it imports ROS."""

from __future__ import annotations

import os
import sys
from importlib import import_module
from pathlib import Path

from fbql_common.core.text import encodable, one_line
from fbql_common.files import remedy
from fbql_common.middleware import absent_middleware
from fbql_common.node_help import asks_for_help, help_text

DONE, FAILED, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130


def start(module: str, function: str) -> int:
    """Runs the program `function` of a module that imports ROS, or prints its help. Returns the exit code.

    The module has the declarations of its node's parameters as PARAMETERS.

    Importing rclpy ends the process if the middleware that the user names is absent, and takes a second, during which
    Ctrl-C would print a traceback.
    """
    if problem := absent_middleware():
        print(one_line(f"{problem}; unset it, or install that middleware"), file=sys.stderr)
        return BAD_INPUT
    try:
        home = import_module(module)
    except KeyboardInterrupt:
        return INTERRUPTED
    if asks_for_help(sys.argv[1:]):
        text = help_text(Path(sys.argv[0]).name, home.__doc__ or "", home.PARAMETERS)
        try:
            print(encodable(text, sys.stdout.encoding), flush=True)
        except OSError as error:
            return stdout_failed(error)
        return DONE
    program = getattr(home, function)
    return program()


def stdout_failed(error: OSError) -> int:
    """The exit code where stdout could not be written: a reader that left is no error, a full disk is said in a line."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # else Python would fail once more when it ends
    if isinstance(error, BrokenPipeError):
        return DONE
    print(f"stdout: cannot be written ({error.strerror}); {remedy(error)}", file=sys.stderr)
    return FAILED
