"""What is to be made, and where: the wheels' environment, or the one on top of a sourced system Jazzy."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

DISTRO = "jazzy"


@dataclass(frozen=True)
class Target:
    """Places of one environment. `underlay` holds the prefixes of a system Jazzy; it is empty with the wheels."""

    root: Path
    venv: Path
    run_lock: Path
    test_lock: Path
    study_lock: Path
    workspace: Path
    build: Path
    install: Path
    log: Path
    underlay: tuple[Path, ...] = ()

    def lock_of(self, purpose: str) -> Path:
        """The lock file of a purpose: run, or one of the extras test and study, each a superset of run's."""
        return {"run": self.run_lock, "test": self.test_lock, "study": self.study_lock}[purpose]

    @property
    def python(self) -> Path:
        """The environment's interpreter."""
        return self.venv / "bin" / "python"

    @property
    def site_packages(self) -> Path:
        """Where the environment's packages are."""
        return self.venv / "lib" / "python3.12" / "site-packages"

    @property
    def state(self) -> Path:
        """The set-up's own directory: the lock file and the logs."""
        return self.root / ".setup"


def target_for(root: Path, environ: Mapping[str, str]) -> Target:
    """The environment that belongs to the checkout `root`, started with the variables `environ`."""
    underlay = sourced_underlay(root, environ)
    workspace = root / "ros2_ws"
    if underlay:
        state = root / ".setup" / "system"
        return Target(
            root=root,
            venv=root / ".venv-system",
            run_lock=root / "requirements-system.txt",
            test_lock=root / "requirements-system-test.txt",
            study_lock=root / "requirements-system-study.txt",
            workspace=workspace,
            build=state / "build",
            install=state / "install",
            log=state / "log",
            underlay=underlay,
        )
    return Target(
        root=root,
        venv=root / ".venv",
        run_lock=root / "requirements.txt",
        test_lock=root / "requirements-test.txt",
        study_lock=root / "requirements-study.txt",
        workspace=workspace,
        build=workspace / "build",
        install=workspace / "install",
        log=workspace / "log",
    )


def sourced_underlay(root: Path, environ: Mapping[str, str]) -> tuple[Path, ...]:
    """The prefixes of a sourced system Jazzy, in order; empty when none is sourced.

    Sourced means: ROS_DISTRO says jazzy, and a prefix on AMENT_PREFIX_PATH outside of this checkout holds rclpy.
    """
    if environ.get("ROS_DISTRO") != DISTRO:
        return ()
    prefixes = tuple(prefix for prefix in split_path(environ.get("AMENT_PREFIX_PATH")) if not is_inside(prefix, root))
    if any(next(prefix.glob("lib/python3*/*-packages/rclpy"), None) for prefix in prefixes):
        return prefixes
    return ()


def split_path(value: str | None) -> list[Path]:
    """The entries of a search path variable."""
    return [Path(entry) for entry in (value or "").split(os.pathsep) if entry]


def is_inside(path: Path, directory: Path) -> bool:
    """Whether `path`, as written or with its links followed, is `directory` or below it."""
    resolved = path.resolve()
    return directory in (path, *path.parents, resolved, *resolved.parents)
