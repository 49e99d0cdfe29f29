"""From an entry script to its command: ensure that the environment exists, then become a process in it."""

from __future__ import annotations

import importlib
import os
import sys
from collections.abc import Mapping
from pathlib import Path

from .progress import SetUpError, shown, write
from .target import Target, target_for
from .variables import process_environment

ROOT = Path(__file__).resolve().parents[2]

# Set to the process id when an entry starts itself again in the environment. exec keeps the process id, and no child
# has it, so that this is never inherited by an entry that has yet to look after its environment.
ENTERED = "_FBQL_ENTERED"


def enter(name: str, purpose: str = "run", module: str = "") -> None:
    """Run `fbql NAME`, the test suite, or `MODULE.main(argv)` where a module is named, in the environment, and exit with
    what it returns.

    `purpose` is run, test (adds the test tools), study (adds what studies need) or bags (adds what reads bags of others);
    the last two not if only the help is requested. Does not return.
    """
    if os.environ.pop(ENTERED, None) == str(os.getpid()):
        if name == "test":
            run_tests(sys.argv[1:])
        if module:
            sys.exit(importlib.import_module(module).main(sys.argv[1:]))
        from fbql.cli.app import run

        sys.exit(run(name, sys.argv[1:], f"{name}.py"))
    if purpose in ("study", "bags") and not {"-h", "--help"}.isdisjoint(sys.argv[1:]):
        purpose = "run"
    target, environ = environment_or_exit(purpose)
    environ[ENTERED] = str(os.getpid())
    os.execve(target.python, [str(target.python), sys.argv[0], *sys.argv[1:]], environ)


def run_tests(argv: list[str]) -> None:
    """Become pytest on the checkout, from any working directory; without arguments all but the long tests."""

    def absolute(argument: str) -> str:
        path, separator, test = argument.partition("::")
        is_there = path and os.path.exists(path)  # noqa: PTH110 - Path.exists raises for a long name
        return str(Path(path).resolve()) + separator + test if is_there else argument

    arguments = [absolute(argument) for argument in argv]
    os.chdir(ROOT)
    os.execv(sys.executable, [sys.executable, "-m", "pytest", "-m", "not long", *arguments])


def environment_or_exit(purpose: str = "run") -> tuple[Target, dict[str, str]]:
    """The environment, created if necessary, and the variables of a process in it; on an error one line and exit code
    2."""
    open_standard_streams()
    try:
        return ensure_environment(ROOT, purpose, os.environ)
    except SetUpError as error:
        write((f"{error.details}\n" if error.details else "") + f"fbql: {shown(error)}\n")
        sys.exit(2)
    except KeyboardInterrupt:
        write("fbql: the set-up was interrupted; the next start resumes it.\n")
        sys.exit(130)


def open_standard_streams() -> None:
    """Open /dev/null for those of stdin, stdout and stderr that are closed: so that no other file gets their
    numbers."""
    while (descriptor := os.open(os.devnull, os.O_RDWR)) <= 2:
        os.set_inheritable(descriptor, True)
    os.close(descriptor)


def ensure_environment(root: Path, purpose: str, environ: Mapping[str, str]) -> tuple[Target, dict[str, str]]:
    """The environment of the checkout `root`, set up if need be, and the variables of a process in it."""
    target = target_for(root, environ)
    packages = target.packages()
    if not target.is_ready(purpose, packages):
        from .set_up import set_up  # it and what it imports are not needed by a start that has nothing to do

        packages = set_up(target, purpose, environ)
    return target, process_environment(target, environ, packages)
