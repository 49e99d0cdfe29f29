"""metadata.yaml beside its files: what it says of them in a shape that can be relied on, and where they disagree."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from fbql_recording.mcap.reader import McapFile, Topic

_TOLERANCE_NS = 1000
"""By how much times may differ: some writers count the last message's own nanosecond."""


@dataclass
class Told:
    """The contents of metadata.yaml; None or empty where it has nothing usable."""

    messages: int | None = None
    start_ns: int | None = None
    duration_ns: int | None = None
    topics: dict[str, tuple[str, int | None]] = field(default_factory=dict[str, tuple[str, int | None]])
    """Type and number of messages, by topic."""
    files: dict[str, int | None] = field(default_factory=dict[str, int | None])
    """Number of messages, by file."""
    odd: list[str] = field(default_factory=list[str])
    """Entries of a wrong type or out of range, in words; they are not used."""


def told_by(information: Mapping[str, Any]) -> Told:
    """The contents of `rosbag2_bagfile_information`."""
    told = Told()
    told.messages = _number(told, information, "message_count")
    told.start_ns = _number(told, information.get("starting_time"), "nanoseconds_since_epoch", "starting_time: ")
    told.duration_ns = _number(told, information.get("duration"), "nanoseconds", "duration: ")
    for entry in _entries(told, information, "topics_with_message_count"):
        about = entry.get("topic_metadata")
        name, kind = (about.get("name"), about.get("type")) if isinstance(about, dict) else (None, None)
        if not isinstance(name, str) or not isinstance(kind, str):
            told.odd.append("topics_with_message_count: a topic without a name or type")
        elif name in told.topics:
            told.odd.append(f"topic {name} is there twice")
        else:
            told.topics[name] = kind, _number(told, entry, "message_count", f"topic {name}: ")
    for entry in _entries(told, information, "files"):
        path = entry.get("path")
        if not isinstance(path, str):
            told.odd.append("files: a file without a path")
        else:
            told.files[path] = _number(told, entry, "message_count", f"file {path}: ")
    return told


def _entries(told: Told, information: Mapping[str, Any], name: str) -> Iterator[dict[str, Any]]:
    """The mappings in a list."""
    values = information.get(name)
    if values is not None and not isinstance(values, list):
        told.odd.append(f"{name} is not a list")
        return
    for value in values or []:
        if isinstance(value, dict):
            yield value
        else:
            told.odd.append(f"{name} has {value!r:.50}")


def _number(told: Told, values: Any, name: str, where: str = "") -> int | None:
    """A number of messages or nanoseconds, if there is one."""
    if values is None:
        return None
    value = values.get(name) if isinstance(values, dict) else values
    if value is None:
        return None
    if type(value) is not int or value < 0:
        told.odd.append(f"{where}{name} is {value!r:.50}")
        return None
    return value


@dataclass
class Agreement:
    """Where metadata.yaml and its files disagree."""

    differences: list[str]
    """In words."""
    is_short: bool
    """Whether the files hold less than it says."""


def compare(told: Told, files: Sequence[McapFile], topics: Mapping[str, Topic]) -> Agreement:
    """Compares what metadata.yaml says with whole files of a recording."""
    differences = [f"{what}; not used" for what in told.odd]
    is_short = False
    counts = {name: sum(file.counts.get(name, 0) for file in files) for name in topics}

    def count(what: str, said: int | None, found: int) -> None:
        nonlocal is_short
        if said is not None and said != found:
            differences.append(f"{what}: {said} messages, but there are {found}")
            is_short |= said > found

    # Topics that are left out are in the files, but not in the counts.
    is_counted = not any(file.left_out for file in files)
    if is_counted:
        count("all topics", told.messages, sum(counts.values()))
    for name, (kind, said) in told.topics.items():
        if name in topics:
            if is_counted:
                count(f"topic {name}", said, counts[name])
            if topics[name].type_name != kind:
                differences.append(f"topic {name}: type {kind}, but it is {topics[name].type_name or 'without one'}")
        elif said:
            count(f"topic {name}", said, 0)
    differences += [f"topic {name}: not there" for name in topics if told.topics and name not in told.topics]
    by_name = {file.path.name: file for file in files}
    for path, said in told.files.items():
        file = by_name.get(path.rpartition("/")[2])
        if file is None:
            differences.append(f"files: {path}, which is not among relative_file_paths")
        elif is_counted:
            count(f"file {path}", said, sum(file.counts.values()))
    starts = [file.start_ns for file in files if file.start_ns is not None]
    ends = [file.end_ns for file in files if file.end_ns is not None]
    if starts and ends:
        for what, said, found in (
            ("starting_time", told.start_ns, min(starts)),
            ("duration", told.duration_ns, max(ends) - min(starts)),
        ):
            if said is not None and abs(said - found) > _TOLERANCE_NS:
                differences.append(f"{what}: {said} ns, but it is {found} ns")
    return Agreement(differences, is_short)
