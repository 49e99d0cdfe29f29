"""A checkout, as the set-up looks at one, whose environment seems to be made. Nothing in it runs."""

from __future__ import annotations

import sys
from pathlib import Path

from environment import stamps, virtual
from environment.target import Target, target_for
from environment.workspace import Package


def wheels_target(root: Path) -> Target:
    """The places of the checkout `root` where no system ROS is sourced."""
    return target_for(root, {})


def made_target(root: Path) -> Target:
    """A checkout at `root` with an environment that is stamped for the run lock."""
    target = wheels_target(root)
    target.python.parent.mkdir(parents=True)
    target.python.symlink_to(sys.executable)
    target.run_lock.write_text("a==1 \\\n    --hash=sha256:00\n")
    target.test_lock.write_text("a==1 \\\n    --hash=sha256:00\nb==2 \\\n    --hash=sha256:11\n")
    target.study_lock.write_text("a==1 \\\n    --hash=sha256:00\nc==3 \\\n    --hash=sha256:22\n")
    hashes = virtual.lock_hashes(target)
    stamps.write(target.venv / virtual.STAMP, {"path": str(target.venv), "run": hashes["run"]})
    return target


def packages() -> list[Package]:
    """A compiled package, and one in Python that depends on it."""
    return [
        Package("messages", Path("/src/messages"), "ament_cmake", frozenset()),
        Package("node", Path("/src/node"), "ament_python", frozenset({"messages"})),
    ]
