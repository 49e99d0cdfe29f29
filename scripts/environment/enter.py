"""From a command's door to the command: make sure of the environment, then become a process in it."""

from __future__ import annotations

import importlib
import os
import sys
from collections.abc import Mapping
from pathlib import Path

from . import virtual, workspace
from .errors import SetUpError
from .process import process_environment
from .progress import write
from .target import Target, target_for

ROOT = Path(__file__).resolve().parents[2]

# Set to the process id when an entry starts itself again in the environment. exec keeps the process id, and no child
# has it, so that this is never inherited by an entry that has yet to look after its environment.
ENTERED = "_FBQL_ENTERED"
_HELP = {"-h", "--help"}


def enter(name: str, *, purpose: str = "run", module: str = "") -> None:
    """Run `fbql NAME`, or `MODULE.main(argv)` where a module is named, in the environment; exit with what it returns.

    `purpose` is run, test (adds the test tools) or study (adds what studies need, but not where only its help is asked for).
    Does not return.
    """
    if os.environ.pop(ENTERED, None) == str(os.getpid()):
        if module:
            sys.exit(importlib.import_module(module).main(sys.argv[1:]))
        sys.exit(importlib.import_module("fbql.cli.app").run(name, sys.argv[1:], f"{name}.py"))
    if purpose == "study" and _HELP.intersection(sys.argv[1:]):
        purpose = "run"
    target, environ = environment_or_exit(purpose)
    environ[ENTERED] = str(os.getpid())
    os.execve(target.python, [str(target.python), sys.argv[0], *sys.argv[1:]], environ)


def environment_or_exit(purpose: str = "run") -> tuple[Target, dict[str, str]]:
    """The environment, made if need be, and the variables of a process in it; on an error one line and exit code 2."""
    open_standard_streams()
    try:
        return ensured_environment(ROOT, purpose, os.environ)
    except SetUpError as error:
        details = f"{error.details}\n" if error.details else ""
        write(f"{details}fbql: {error}\n")
        sys.exit(2)
    except KeyboardInterrupt:
        write("fbql: the set-up was interrupted; the next start goes on with it.\n")
        sys.exit(130)


def open_standard_streams() -> None:
    """Open /dev/null for those of stdin, stdout and stderr that are closed: no other file must get their numbers."""
    while (descriptor := os.open(os.devnull, os.O_RDWR)) <= 2:
        os.set_inheritable(descriptor, True)
    os.close(descriptor)


def ensured_environment(root: Path, purpose: str, environ: Mapping[str, str]) -> tuple[Target, dict[str, str]]:
    """The environment of the checkout `root`, set up if need be, and the variables of a process in it."""
    target = target_for(root, environ)
    if not is_ready(target, purpose):
        from .set_up import set_up  # it and what it imports are not needed by a start that has nothing to do

        set_up(target, purpose, environ)
    packages = workspace.find_packages(target.workspace / "src")
    return target, process_environment(target, environ, packages)


def is_ready(target: Target, purpose: str) -> bool:
    """Whether everything is installed and built from what the checkout holds now."""
    if not virtual.is_installed(target, purpose):
        return False
    wanted = workspace.fingerprints(target, workspace.find_packages(target.workspace / "src"))
    return not workspace.stale_packages(target, wanted) and not workspace.leftover_packages(target, wanted)
