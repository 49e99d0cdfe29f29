"""Where a recording's files are: a run directory, any directory that `ros2 bag` accepts, or one MCAP file alone.

Nothing outside the directory is ever read, not even if its metadata.yaml or a symbolic link in it points there.
"""

from __future__ import annotations

import os
import re
from dataclasses import dataclass, field, replace
from pathlib import Path, PurePosixPath
from typing import Any

from fbql_common.core.errors import BadInput
from fbql_common.files import read_file, unreadable

from fbql_recording.plain_yaml import mapping_from_yaml

MAX_TEXT_BYTES = 16 * 2**20
"""Largest metadata.yaml, config.yaml or similar file that is read."""


@dataclass
class RunFiles:
    """The files of a recording."""

    directory: Path | None
    """The run directory, or None for an MCAP file alone."""
    recordings: list[Path]
    """The MCAP files, in order."""
    information: dict[str, Any] = field(default_factory=dict[str, Any])
    """`rosbag2_bagfile_information` of metadata.yaml; empty without one."""
    warnings: list[str] = field(default_factory=list[str])
    missing: list[str] = field(default_factory=list[str])
    """Names of files that belong to it and are not there; only of a damaged recording."""


def find_files(path: Path) -> RunFiles:
    """The files of the recording at `path`.

    Raises:
        BadInput: there is none, it is not MCAP, or its metadata names a file outside of the directory.
    """
    try:
        if path.is_dir():
            return _in_directory(path)
        if not path.exists():
            raise BadInput(f"{path}: no such run or recording")
    except OSError as error:  # a name that is too long, a directory that can't be listed
        raise unreadable(Path(os.fsdecode(error.filename or path)), error) from None
    return RunFiles(None, [path])


def find_damaged_files(path: Path) -> RunFiles:
    """The files of a recording whose metadata.yaml may be damaged too: then all recordings of the directory are taken.

    Raises:
        BadInput: there is none.
    """
    if not os.path.isdir(path):  # noqa: PTH112 - Path.is_dir raises for a long name
        return find_files(path)
    missing: list[str] = []
    try:
        files = _in_directory(path, missing)
        if files.recordings:
            return replace(files, missing=missing)
        error = f"{path / 'metadata.yaml'} names no file that is there"
    except BadInput as found:
        error = str(found)
        if not _recordings_in(path):
            raise
    names = _recordings_in(path)
    if not names:
        raise BadInput(f"{path}: no recording there; metadata.yaml names {', '.join(missing)}")
    missing += _lacking_numbers(names)
    return RunFiles(path, [_inside(path, name) for name in names], warnings=[f"{error}; not used"], missing=missing)


def _lacking_numbers(names: list[str]) -> list[str]:
    """The names that lack between NAME_0.mcap, NAME_1.mcap and so on."""
    found = [match for name in names if (match := re.fullmatch(r"(.*_)(\d{1,4})\.mcap(\.active)?", name))]
    there = {(match[1], int(match[2])) for match in found}
    if len(there) < 2:
        return []
    last = max(number for _, number in there)
    stem = found[0][1]
    return [f"{stem}{number}.mcap" for number in range(last) if all((match[1], number) not in there for match in found)]


def read_inside(directory: Path, name: str) -> bytes | None:
    """A file of a run directory; None where there is none.

    Raises:
        BadInput: it is outside of the directory, too large, or can't be read.
    """
    path = _inside(directory, name)
    if not path.is_file():
        return None
    return read_file(path, MAX_TEXT_BYTES)


def _in_directory(directory: Path, missing: list[str] | None = None) -> RunFiles:
    """The files of a directory; names of files that are not there go to `missing`, or raise BadInput without it."""
    data = read_inside(directory, "metadata.yaml")
    if data is None:
        return _without_metadata(directory)
    where = str(directory / "metadata.yaml")
    information = mapping_from_yaml(data, where).get("rosbag2_bagfile_information")
    if not isinstance(information, dict):
        raise BadInput(f"{where}: not the metadata of a bag (rosbag2_bagfile_information is missing)")
    storage = information.get("storage_identifier")
    if storage not in ("mcap", "", None):  # nothing in a bag that was reindexed
        raise BadInput(f"{where}: a bag of '{storage}', only mcap is read; convert it with `ros2 bag convert`")
    if information.get("compression_format"):
        raise BadInput(f"{where}: its files are compressed as a whole; convert it with `ros2 bag convert`")
    names = information.get("relative_file_paths")
    if not isinstance(names, list) or not names or not all(isinstance(name, str) for name in names):
        raise BadInput(f"{where}: it names no recording (relative_file_paths)")
    for name in ("topics_with_message_count", "files"):
        if not isinstance(information.get(name) or [], list):
            raise BadInput(f"{where}: {name} is not a list")
    recordings: dict[Path, Path] = {}
    warnings: list[str] = []
    for name in names:
        recording = _inside(directory, name)
        if not recording.is_file():
            if missing is None:
                raise BadInput(f"{where} names {recording.name}, which is not there")
            missing.append(recording.name)
        elif recordings.setdefault(recording.resolve(), recording) is not recording:
            warnings.append(f"{where}: names {recording.name} twice; it is read once")
    return RunFiles(directory, list(recordings.values()), information, warnings)


def _without_metadata(directory: Path) -> RunFiles:
    names = _recordings_in(directory)
    if not names:
        is_run = (directory / "config.yaml").is_file()
        hint = "; it is a run that was not recorded: run it again with record:=true" if is_run else ""
        raise BadInput(f"{directory}: no recording there (neither metadata.yaml nor an .mcap file){hint}")
    if len(names) > 1:
        raise BadInput(f"{directory}: no metadata.yaml, and more than one recording ({', '.join(names)}); name one")
    warning = f"{directory}: no metadata.yaml: the recording was not finished"
    return RunFiles(directory, [_inside(directory, names[0])], warnings=[warning])


def _recordings_in(directory: Path) -> list[str]:
    """The names of MCAP files, in the order of their numbers."""
    names = [path.name for path in directory.iterdir() if path.name.endswith((".mcap", ".mcap.active"))]
    return sorted(names, key=lambda name: [int(part) if part.isdigit() else part for part in re.split(r"(\d+)", name)])


def _inside(directory: Path, name: str) -> Path:
    """A file of the directory. Raises BadInput for a name, or a link, that leads out of it."""
    path = directory / name
    try:
        is_inside = path.resolve().is_relative_to(directory.resolve())
    except (OSError, RuntimeError, ValueError):  # a circle of links; a name with a null byte
        is_inside = False
    if not is_inside or PurePosixPath(name).is_absolute():
        raise BadInput(f"{directory}: {name!r} leads out of the directory; it is not read")
    return path
