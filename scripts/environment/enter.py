"""From an entry script to its command: ensure that the environment exists, then become a process in it."""

from __future__ import annotations

import importlib
import os
import sys
from collections.abc import Callable

from .signals import hold_signals, let_signals_in

# Set to the process id when an entry starts itself again in the environment. exec keeps the process id, and no child
# has it, so that this is never inherited by an entry that has yet to look after its environment.
ENTERED = "_FBQL_ENTERED"
INTERRUPTED = 130
"""Exit code of a program that Ctrl-C ended, as a shell reports it."""


def enter(name: str, purpose: str = "run", module: str = "") -> None:
    """Run `fbql NAME`, the test suite, or `MODULE.main(argv)` where a module is named, in the environment, and exit with
    what it returns.

    `purpose` is run, test (adds the test tools), study (adds what studies need) or bags (adds the reader of bags);
    the last two not if only the help is requested. Does not return.

    Signals that end a program wait until the command is there to act on them.
    """
    hold_signals()
    if os.environ.pop(ENTERED, None) == str(os.getpid()):
        if name == "test":
            sys.exit(interruptible(run_tests))
        if module:
            sys.exit(interruptible(importlib.import_module(module).main))
        from fbql.cli.app import run

        sys.exit(run(name, sys.argv[1:], f"{name}.py"))
    if purpose in ("study", "bags") and not {"-h", "--help"}.isdisjoint(sys.argv[1:]):
        purpose = "run"
    from .ready import environment_or_exit

    target, environ = environment_or_exit(purpose)
    environ[ENTERED] = str(os.getpid())
    os.execve(target.python, [str(target.python), sys.argv[0], *sys.argv[1:]], environ)


def enter_ros2() -> None:
    """Do what `scripts/ros2` does, and exit with its code unless another program takes this process's place."""
    hold_signals()
    from .ros2 import main

    sys.exit(interruptible(main, let_in=False))


def interruptible(main: Callable[[list[str]], int | None], *, let_in: bool = True) -> int | None:
    """The exit code of `main(argv)`, in which signals act, unless it lets them in by itself; INTERRUPTED if Ctrl-C ends
    it."""
    try:
        if let_in:
            let_signals_in()
        return main(sys.argv[1:])
    except KeyboardInterrupt:
        return INTERRUPTED


def run_tests(argv: list[str]) -> None:
    """Become pytest on the checkout, from any working directory; without arguments all but the long tests."""
    from pathlib import Path

    from .ready import ROOT

    def absolute(argument: str) -> str:
        path, separator, test = argument.partition("::")
        is_there = path and os.path.exists(path)  # noqa: PTH110 - Path.exists raises for a long name
        return str(Path(path).resolve()) + separator + test if is_there else argument

    arguments = [absolute(argument) for argument in argv]
    os.chdir(ROOT)
    os.execv(sys.executable, [sys.executable, "-m", "pytest", "-m", "not long", *arguments])
