"""From an entry script to its command: ensure that the environment exists, then become a process in it."""

from __future__ import annotations

import importlib
import os
import sys

from .signals import hold_signals, let_signals_in

# Set to the process id when an entry starts itself again in the environment. exec keeps the process id, and no child
# has it, so that this is never inherited by an entry that has yet to look after its environment.
ENTERED = "_FBQL_ENTERED"


def enter(name: str, purpose: str = "run", module: str = "") -> None:
    """Run `fbql NAME`, the test suite, or `MODULE.main(argv)` where a module is named, in the environment, and exit with
    what it returns.

    `purpose` is run, test (adds the test tools), study (adds what studies need) or bags (adds what reads bags of others);
    the last two not if only the help is requested. Does not return.

    Signals that end a program wait until the command is there to act on them.
    """
    hold_signals()
    if os.environ.pop(ENTERED, None) == str(os.getpid()):
        if module or name == "test":
            let_signals_in()
        if name == "test":
            run_tests(sys.argv[1:])
        if module:
            sys.exit(importlib.import_module(module).main(sys.argv[1:]))
        from fbql.cli.app import run

        sys.exit(run(name, sys.argv[1:], f"{name}.py"))
    if purpose in ("study", "bags") and not {"-h", "--help"}.isdisjoint(sys.argv[1:]):
        purpose = "run"
    from .ready import environment_or_exit

    target, environ = environment_or_exit(purpose)
    environ[ENTERED] = str(os.getpid())
    os.execve(target.python, [str(target.python), sys.argv[0], *sys.argv[1:]], environ)


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
