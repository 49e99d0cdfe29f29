"""Shared memory of Fast DDS that killed processes left in /dev/shm.

Fast DDS removes its files at an orderly end only; what is left of killed processes fills /dev/shm, 64 MB in many containers,
until no node can start. A file is in use while a process holds the lock on its lock file (`fastdds shm clean` uses the same
rule). One that is starting makes its files before it locks them, so files made a moment ago are left alone.
"""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from time import time

from fbql_common.files import is_locked

SHARED_MEMORY = Path("/dev/shm")
SUFFIXES = ("_el", "_sl")
"""Lock files beside a segment or a port: exclusive, shared."""
STARTING_S = 30.0
"""Time that a program may take, on a busy machine, from making its files to locking them [s]."""


def remove_leftovers(directory: Path = SHARED_MEMORY) -> list[str]:
    """Removes the segments and ports whose owners are dead; returns their names. Skips what belongs to other users."""
    names = {path.name.removesuffix("_el").removesuffix("_sl") for path in directory.glob("fastrtps_*")}
    dead = sorted(
        name
        for name in names
        if not any(_is_in_use(directory / f"{name}{suffix}") for suffix in SUFFIXES)
        and not any(_is_new(directory / f"{name}{suffix}") for suffix in ("", *SUFFIXES))
    )
    for name in dead:
        for file in (name, *(f"{name}{suffix}" for suffix in SUFFIXES), f"sem.{name}_mutex"):
            with suppress(OSError):
                (directory / file).unlink()
    return dead


def _is_in_use(path: Path) -> bool:
    """Whether a process holds the lock; True, too, where that cannot be told."""
    try:
        return is_locked(path)
    except FileNotFoundError:
        return False
    except OSError:
        return True


def _is_new(path: Path) -> bool:
    try:
        return time() - path.stat().st_ctime < STARTING_S
    except OSError:
        return False
