"""The environment of a checkout, which is set up where it is not ready."""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping
from pathlib import Path

from .progress import SetUpError, shown, write
from .signals import signals_let_in
from .target import Target, target_for
from .variables import process_environment

ROOT = Path(__file__).resolve().parents[2]


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
        write("fbql: the set-up was interrupted; the next start repeats what is unfinished.\n")
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

        with signals_let_in():
            packages = set_up(target, purpose, environ)
    return target, process_environment(target, environ, packages)
