"""A study's directory: its options, a file for each finished task, and a lock that keeps out a second run.

config.json         the study and its options
tasks/KEY.json      the result of a task that is done
tasks/KEY.failed    why a task failed; removed once it is done
revisions.json      the project revisions that ran tasks, in order
lock                held while a run uses the directory
"""

from __future__ import annotations

import fcntl
import json
import os
from pathlib import Path
from types import TracebackType
from typing import Any

from fbql_common.core.errors import BadInput
from fbql_common.core.plain_json import json_from
from fbql_common.files import output_directory, remedy, write_atomically

from fbql_studies.runner.study import Result

COUNTS = ("seeds", "trees", "searches")
"""Options that set a number of tasks. A directory serves any value: a task that depends on one has it in its key."""
_MADE_FIRST = {"tasks", "lock"}
"""Files that exist before config.json does."""


class Store:
    """Keeps a study's results. A task's file is written completely or not at all, so that a run can resume after any
    interruption.

    Args:
        directory: created if it does not exist.
        config: what the tasks depend on (study and options), as JSON values. A directory of the same study with other COUNTS
            is resumed with them; a directory in which no task has ended may be taken by any study.

    Raises:
        BadInput: the directory can't be used, contains other files, belongs to another study or other options, or is in
            use by a run.
    """

    def __init__(self, directory: Path, config: dict[str, Any]) -> None:
        self.directory = directory
        try:
            others = _others_in(directory)
            if others and "config.json" not in others:
                raise BadInput(f"{directory}: not a study's directory: it contains {min(others)}; choose a new one")
            with output_directory(directory / "tasks"):
                self._begin(config)
        except OSError as error:
            raise BadInput(f"{directory}: can't be used for a study ({error.strerror}); {remedy(error)}") from None

    def _begin(self, config: dict[str, Any]) -> None:
        lock = self.directory / "lock"
        is_new = not lock.exists()
        self._lock = os.open(lock, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
        try:
            self._take_lock()
            try:
                self._take(config)
            except OSError:
                if is_new:
                    lock.unlink(missing_ok=True)
                raise
        except BaseException:
            os.close(self._lock)
            raise

    def _take_lock(self) -> None:
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise BadInput(
                f"{self.directory}: a study is running there now; wait for it or choose another directory"
            ) from None

    def _take(self, config: dict[str, Any]) -> None:
        path = self.directory / "config.json"
        try:
            is_new = not path.exists()
            found = config if is_new else _parsed(path.read_text())
            if _is_a_study(found) and self._is_unused():
                found, is_new = config, True
            if _without_counts(found) == _without_counts(config):
                if is_new or found != config:
                    text = json.dumps(config, indent=2, sort_keys=True)
                    write_atomically(path, f"{text}\n".encode())
                return
        except ValueError as error:
            raise BadInput(f"{path}: can't be used ({error}); choose another directory") from None
        raise BadInput(f"{self.directory}: holds {_difference(found, config)}; choose another directory")

    def _is_unused(self) -> bool:
        """Whether a study was started here but no task has ended."""
        return not _others_in(self.directory) - {"config.json"} and not any((self.directory / "tasks").iterdir())

    def __enter__(self) -> Store:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        os.close(self._lock)

    def result_of(self, key: str) -> Result | None:
        """A task's result; None when it is not done. A file that can't be read or holds no result counts as not done."""
        try:
            found = json_from(_result_path(self.directory, key).read_bytes())
            return found if isinstance(found, dict) and found else None
        except (OSError, ValueError):
            return None

    def revisions(self) -> list[str]:
        """The revisions of the project that ran the tasks, in order."""
        try:
            found = _parsed((self.directory / "revisions.json").read_text(errors="replace"))
        except OSError:
            return []
        return [str(each) for each in found] if isinstance(found, list) else ["unknown"]

    def add_revision(self, revision: str) -> None:
        """Records the revision that runs the tasks from now on."""
        known = self.revisions()
        if revision not in known:
            text = json.dumps([*known, revision])
            write_atomically(self.directory / "revisions.json", f"{text}\n".encode())

    def failure_of(self, key: str) -> str:
        """Why a task failed; empty when it did not."""
        try:
            return _failure_path(self.directory, key).read_text().strip()
        except (OSError, ValueError):
            return ""


def _others_in(directory: Path) -> set[str]:
    """Names in a directory that an interrupted study can't have left there without a config.json."""
    names = {path.name for path in directory.iterdir()} if directory.exists() else set[str]()
    return {name for name in names if name not in _MADE_FIRST and not name.startswith(".config.json.")}


def _parsed(text: str) -> Any:
    """The value of a JSON text; None where it is not JSON."""
    try:
        return json_from(text.encode())
    except ValueError:
        return None


def _is_a_study(config: Any) -> bool:
    """Whether a config.json is one of ours."""
    match config:
        case {"study": str(), "options": dict(), **others} if not others:
            return True
        case _:
            return False


def _without_counts(config: Any) -> Any:
    """The content of a config.json without COUNTS."""
    match config:
        case {"options": dict() as options}:
            return {**config, "options": {name: value for name, value in options.items() if name not in COUNTS}}
        case _:
            return config


def _difference(found: Any, asked: dict[str, Any]) -> str:
    """How the study in config.json differs from the requested one."""
    try:
        if found["study"] != asked["study"]:
            return f"the study {found['study']}, not {asked['study']}"
        own, others = (_without_counts(config)["options"] for config in (found, asked))
        name = next(
            name
            for name in (*others, *sorted(own))
            if name not in own.keys() & others.keys() or own[name] != others[name]
        )
        return f"this study with {_option(name, own)}, not {_option(name, others)}"
    except (KeyError, TypeError, AttributeError, StopIteration):
        return "a config.json that is not a study's"


def _option(name: str, options: dict[str, Any]) -> str:
    """An option as it is typed, or that it was not given."""
    value = options.get(name)
    option = f"--{name.replace('_', '-')}"
    if value is None or value == []:
        return f"no {option}"
    return f"{option} {' '.join(map(str, value)) if isinstance(value, list) else value}"


def write_result(directory: Path | str, key: str, result: Result) -> None:
    """Writes a task's result, completely or not at all. Raises ValueError for a number that is not finite."""
    text = json.dumps(result, sort_keys=True, allow_nan=False) + "\n"
    write_atomically(_result_path(directory, key), text.encode())
    _failure_path(directory, key).unlink(missing_ok=True)


def write_failure(directory: Path | str, key: str, reason: str) -> None:
    """Records why a task failed."""
    write_atomically(_failure_path(directory, key), f"{reason}\n".encode())


def _result_path(directory: Path | str, key: str) -> Path:
    return Path(directory) / "tasks" / f"{key}.json"


def _failure_path(directory: Path | str, key: str) -> Path:
    return Path(directory) / "tasks" / f"{key}.failed"
