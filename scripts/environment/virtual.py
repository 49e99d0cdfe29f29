"""The virtual environment and what is installed in it.

A stamp inside the environment says where it was made, on which interpreter, and from which locks. While it is being
changed the mark UNFINISHED stands beside the stamp: whoever finds it later, with nobody holding the set-up's lock,
knows that the work was cut off at an unknown point, and starts afresh.
"""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Any

from . import stamps
from .target import Target

STAMP = "fbql-environment.json"
UNFINISHED = "fbql-unfinished"
EXTRAS = ("test", "study")
"""What can be installed on top of what every command needs."""


def stamp_of(target: Target) -> dict[str, Any]:
    """The environment's stamp; empty when it is half-made, moved, or stands on a Python that is gone."""
    if (target.venv / UNFINISHED).exists():
        return {}
    stamp = stamps.read(target.venv / STAMP)
    if stamp.get("path") != str(target.venv) or not os.access(target.python, os.X_OK):
        return {}
    return stamp


def lock_hashes(target: Target) -> dict[str, str]:
    """For each purpose, the hash of what the lock files say. The extras' locks are supersets of the run lock."""
    run = target.run_lock.read_bytes()
    extras = {purpose: stamps.sha256(run + b"\0" + target.lock_of(purpose).read_bytes()) for purpose in EXTRAS}
    return {"run": stamps.sha256(run), **extras}


def is_installed(target: Target, purpose: str) -> bool:
    """Whether the environment holds what the locks of today ask for `purpose`, which is run or one of EXTRAS."""
    return stamp_of(target).get(purpose) == lock_hashes(target)[purpose]


def requirements(lock: str) -> dict[str, str]:
    """The entries of a lock file by name: each `name==version` with the hashes that follow it."""
    blocks = re.findall(r"^([A-Za-z0-9][\w.-]*)((?:\[[^\]]*\])?==.*(?:\n[ \t].*)*)", lock, flags=re.MULTILINE)
    return {name.lower(): name + rest for name, rest in blocks}


def is_usable(target: Target) -> bool:
    """Whether there is an environment here that can be installed into: made to its end, and in its own place."""
    return bool(stamp_of(target))


def mark_unfinished(target: Target) -> None:
    """Say that work on the environment has begun."""
    target.venv.mkdir(exist_ok=True)
    Path(target.venv, UNFINISHED).touch()


def mark_finished(target: Target, stamp: dict[str, Any]) -> None:
    """Say what the environment holds now, and that nobody works on it."""
    stamps.write(target.venv / STAMP, stamp)
    unmark_unfinished(target)


def unmark_unfinished(target: Target) -> None:
    """Say that the environment is as its stamp says."""
    Path(target.venv, UNFINISHED).unlink()
