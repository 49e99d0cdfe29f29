"""A checkout, as the set-up looks at one, whose environment seems to be made. Nothing in it runs."""

from __future__ import annotations

import sys
from pathlib import Path

from environment.target import ENVIRONMENT_STAMP, Package, Target, write_stamp

LOCK = "{name}==1 \\\n    --hash=sha256:00\n"


def made_target(root: Path) -> Target:
    """A checkout at `root` with an environment that is stamped for the run locks."""
    target = Target(root)
    target.python.parent.mkdir(parents=True)
    target.python.symlink_to(sys.executable)
    (root / "requirements").mkdir()
    for name in ("ros", "run", "test", "study"):
        (root / "requirements" / f"{name}.txt").write_text(LOCK.format(name=name))
    stamp_environment(target, "run")
    return target


def stamp_environment(target: Target, *purposes: str) -> None:
    """As if these purposes had just been installed."""
    stamp = {purpose: target.lock_hash(purpose) for purpose in purposes}
    write_stamp(target.venv / ENVIRONMENT_STAMP, {"path": str(target.venv), **stamp})


def packages() -> list[Package]:
    """A compiled package, and one in Python that depends on it."""
    return [Package("messages", Path("/src/messages"), True), Package("node", Path("/src/node"), False)]
