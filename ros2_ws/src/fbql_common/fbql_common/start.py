"""Starts a node's program, with the checks that must come before it imports ROS."""

from __future__ import annotations

import sys
from importlib import import_module

from fbql_common.core.text import one_line
from fbql_common.middleware import absent_middleware

BAD_INPUT, INTERRUPTED = 2, 130


def start(module: str, function: str) -> int:
    """Runs the program `function` of a module that imports ROS. Returns its exit code.

    Importing rclpy ends the process if the middleware that the user names is absent, and takes a second, during which
    Ctrl-C would print a traceback.
    """
    if problem := absent_middleware():
        print(one_line(f"{problem}; unset it, or install that middleware"), file=sys.stderr)
        return BAD_INPUT
    try:
        program = getattr(import_module(module), function)
    except KeyboardInterrupt:
        return INTERRUPTED
    return program()
