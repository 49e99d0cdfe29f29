"""The run directory, which holds everything that a run writes and is never overwritten.

config.yaml    every parameter in force, versions, git revision
episodes.csv   one row per episode, written as it ends
summary.json   the result
policy.npz     the learned policy, if there is one
trees/         copies of the tree files
log/           logs of the processes
metadata.yaml, <name>_0.mcap   the recording (recording.py)
"""

from __future__ import annotations

import importlib.metadata
import itertools
import json
import os
import platform
import subprocess
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from types import MappingProxyType
from typing import Any

from fbql_common.checkout import source_tree
from fbql_common.core.errors import BadInput
from fbql_common.files import append_whole, check_output, remedy, write_atomically

from fbql_recording.bag_metadata import to_yaml
from fbql_recording.core.metrics import EpisodeRecord, Summary, TaskSummary

EPISODE_COLUMNS = ("index", "phase", "seed", "outcome", "steps", "collisions_begun", "collision_steps", "return")
ROOM_BYTES = 64 * 1024
"""Kept free for the summary, so that even on a full disk a run can be marked as incomplete."""
_PACKAGES = ("numpy", "pymunk", "mcap", "ros-jazzy-rclpy")


def create_run_directory(path: Path) -> None:
    """Makes runs/<name>/ with trees/ and log/.

    Raises:
        BadInput: it exists, its parent does not, or nothing can be written there.
    """
    check_output(path)
    if os.path.lexists(path):
        raise BadInput(f"{path} exists; a run is never overwritten, choose another directory")
    if not os.path.isdir(path.parent):  # noqa: PTH112 - Path.is_dir raises for a path that is too long
        raise BadInput(f"{path}: there is no directory {path.parent}; make it, or choose another place")
    made: list[Path] = []
    try:
        for directory in (path, path / "trees", path / "log"):
            directory.mkdir()
            made.append(directory)
    except OSError as error:
        for directory in reversed(made):
            directory.rmdir()
        raise BadInput(f"{path}: can't create the run directory ({error.strerror}); {remedy(error)}") from None


def create_next_run_directory(runs: Path, name: str) -> Path:
    """Creates runs/NAME or, if that exists, the first of NAME-1, NAME-2 ... that does not; returns its path.

    Several processes may do so at the same time: each gets its own.

    Raises:
        BadInput: nothing can be written there.
    """
    paths = itertools.chain([runs / name], (runs / f"{name}-{count}" for count in itertools.count(1)))
    while True:
        path = next(paths)
        try:
            create_run_directory(path)
            return path
        except BadInput:
            if not os.path.lexists(path):
                raise


class RunDirectory:
    """Writes a run's files. A disk failure is reported once; the run continues, incomplete.

    Args:
        path: made by `create_run_directory` (or by hand), and not yet used by a run.
        config: every parameter in force, by node: plain dicts, lists, texts and numbers.
        tree_files: the tree files that are played; copies go to trees/.
        report: called once, with one line, when something could not be written.

    Raises:
        BadInput: the directory is missing, was used already, or can't be written to; a tree file can't be copied.
            Nothing that was made is left, and nothing is removed that was there before.
    """

    def __init__(
        self, path: Path, config: Mapping[str, Any], tree_files: Sequence[Path], report: Callable[[str], None]
    ) -> None:
        self.path = path
        self.failed = False
        """Whether something could not be written, so that the run is incomplete."""
        self._report = report
        self._made: list[Path] = []
        """The paths that `discard` removes."""
        self._episodes = -1
        self._room = path / ".room_for_the_summary"
        if not path.is_dir():
            raise BadInput(f"{path}: no such run directory; make it with create_run_directory")
        if (path / "config.yaml").exists():
            raise BadInput(f"{path} already holds a run; a run is never overwritten, choose another directory")
        try:
            self._begin(config, tree_files)
        except OSError as error:
            self.discard()
            where = error.filename or path
            raise BadInput(f"{where}: can't begin the run ({error.strerror}); {remedy(error)}") from None
        except UnicodeEncodeError:
            self.discard()
            raise BadInput(f"{path}: can't begin the run: the path of a file that it uses is not UTF-8") from None

    def _begin(self, config: Mapping[str, Any], tree_files: Sequence[Path]) -> None:
        path = self.path
        (path / "trees").mkdir(exist_ok=True)
        for tree_file in tree_files:
            copy = path / "trees" / tree_file.name
            if not os.path.lexists(copy):  # else it was there before, and may be the tree file itself
                self._made.append(copy)
            write_atomically(copy, tree_file.read_bytes())
        self._made.append(path / "config.yaml")
        write_atomically(self._made[-1], to_yaml(dict(config)).encode())
        self._episodes = os.open(path / "episodes.csv", os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o644)
        self._made.append(path / "episodes.csv")
        append_whole(self._episodes, f"{','.join(EPISODE_COLUMNS)}\n".encode())
        self._made.append(self._room)
        write_atomically(self._room, bytes(ROOM_BYTES))

    def discard(self) -> None:
        """Removes everything that was written, of a run that could not begin."""
        self.close()
        for path in self._made:
            with suppress(OSError):
                path.unlink(missing_ok=True)

    def add_episode(self, record: EpisodeRecord) -> None:
        """Adds a row to episodes.csv and passes it to the operating system."""
        values = (
            record.index,
            record.phase.name.lower(),
            record.seed,
            record.outcome,
            record.steps,
            record.collisions_begun,
            record.collision_steps,
            record.return_,
        )
        if not self.failed:
            row = f"{','.join(map(str, values))}\n".encode()
            self._guarded("episodes.csv", lambda: append_whole(self._episodes, row))

    def write_policy(self, content: Callable[[], bytes | None]) -> bytes | None:
        """Writes policy.npz, completely or not at all. Returns what was written: None if there is nothing to write.

        Content that raises BadInput is reported and not written.
        """

        def write() -> bytes | None:
            data = content()
            if data is not None:
                write_atomically(self.path / "policy.npz", data)
            return data

        return self._guarded("policy.npz", write)

    def write_summary(self, summary: Summary | TaskSummary, more: Mapping[str, int] = MappingProxyType({})) -> None:
        """Writes summary.json, completely or not at all; `incomplete` is set if any write failed before.

        Args:
            more: what only some runs have to say.
        """
        values = {**summary._asdict(), **more}
        values["incomplete"] = summary.incomplete or self.failed
        data = (json.dumps(values, indent=2, allow_nan=False) + "\n").encode()
        self._room.unlink(missing_ok=True)
        self._guarded("summary.json", lambda: write_atomically(self.path / "summary.json", data))

    def close(self) -> None:
        """Closes episodes.csv. Further calls do nothing; nothing is written afterwards."""
        if self._episodes >= 0:
            os.close(self._episodes)
            self._episodes = -1
            self._room.unlink(missing_ok=True)

    def _guarded[T](self, name: str, write: Callable[[], T]) -> T | None:
        """Writes, and gives what `write` gives; a failure is latched and reported the first time, never raised."""
        try:
            return write()
        except (OSError, BadInput) as error:
            reason = error.strerror if isinstance(error, OSError) else str(error)
            if not self.failed:
                self._report(f"{self.path / name} could not be written, the run continues, incomplete: {reason}")
            self.failed = True
        return None


def software_versions() -> dict[str, str]:
    """Versions of Python and of the packages that results depend on; packages that are not installed are left out."""
    versions = {"python": platform.python_version()}
    for package in _PACKAGES:
        with suppress(importlib.metadata.PackageNotFoundError):
            versions[package] = importlib.metadata.version(package)
    return versions


def git_revision(directory: Path) -> str:
    """The revision of a source tree: a commit, with "+changes" where files differ from it; "unknown" outside git."""
    commands = (["rev-parse", "HEAD"], ["status", "--porcelain", "--untracked-files=no"])
    texts: list[str] = []
    for command in commands:
        try:
            done = subprocess.run(
                ["git", "-C", str(directory), *command], capture_output=True, text=True, timeout=10, check=True
            )
        except (OSError, subprocess.SubprocessError):
            return "unknown"
        texts.append(done.stdout.strip())
    return texts[0] + ("+changes" if texts[1] else "")


def own_revision() -> str:
    """The revision of the checkout that this code belongs to; "unknown" for an installed package."""
    tree = source_tree()
    return "unknown" if tree is None else git_revision(tree)


def custom_data(config: Mapping[str, Any], node: str = "fusion") -> dict[str, str]:
    """A recording's description of its run, from the run's configuration. `node`: the one that decides."""
    fusion = config["parameters"][node]
    return {
        "controller": str(fusion["controller"]),
        "seed": str(fusion["seed"]),
        "git_revision": str(config["git_revision"]),
        "behaviors": " ".join(fusion["behaviors"]),
    }
