"""Demonstrations as files: MCAP recordings of what the simulator showed and what the instructor commanded.

A recording holds messages of fbql_msgs/WorldState and fbql_msgs/WheelCommand, which are decoded by the schemas recorded
with them, and a Metadata record `fbql` whose entry `behavior` names the behavior. One episode is one demonstration; a
command belongs to the world state of its (episode, step).

Only whole recordings are read: a damaged or truncated one is refused with the reason. No ROS is needed.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import isfinite
from pathlib import Path
from typing import Any, NamedTuple

from fbql_common.core.cdr import Malformed
from fbql_common.core.errors import BadInput
from fbql_common.core.recording_names import RUN_RECORD
from fbql_common.core.types import WheelCommand, World
from fbql_recording.core.decoding import TYPES, MessageCodec
from fbql_recording.mcap.reader import McapFile, Topic

from fbql_behaviors.core.patterns import Demonstration

BEHAVIOR_KEY = "behavior"
CONTROLLER_KEY = "controller"
"""In the recording of a match."""
MAX_STEPS = 1_000_000
"""Steps that are read at most."""
MOST = 1e6
"""Largest position, angle or velocity that is taken for one [m, rad, m/s, rad/s]."""
STEP_BYTES = 1024
"""Memory that a step takes, about [bytes]."""


class Recording(NamedTuple):
    """The demonstrations of one behavior in one file."""

    file: Path
    behavior: str
    """Name of the behavior; empty when the file does not say."""
    demonstrations: list[Demonstration]
    about: dict[str, str]
    """Further entries of the file's Metadata record `fbql`, such as who demonstrated."""


def load_demonstrations(path: Path, behavior: str) -> list[Demonstration]:
    """The demonstrations of a behavior in a recording, or in all recordings below a directory, in the order of names.

    Raises BadInput, naming the file: none there, of another behavior, damaged, truncated, too many.
    """
    found: list[Demonstration] = []
    for recording in load_recordings(path):
        check_behavior(recording, behavior)
        found += recording.demonstrations
    if not found:
        raise BadInput(f"{path}: the recordings hold no demonstration: no world state with its command")
    return found


def check_behavior(recording: Recording, behavior: str) -> None:
    """Raises BadInput, saying what the recording is instead, unless it holds demonstrations of this behavior."""
    if recording.behavior and recording.behavior == behavior:
        return
    if recording.behavior:
        raise BadInput(f"{recording.file}: holds demonstrations of '{recording.behavior}', not of '{behavior}'")
    if controller := recording.about.get(CONTROLLER_KEY):
        raise BadInput(
            f"{recording.file}: a match of {controller}, not demonstrations; `replay RUN --watch` shows a match, "
            "`demonstrate` records demonstrations"
        )
    raise BadInput(f"{recording.file}: not demonstrations recorded by `demonstrate`: it does not name their behavior")


def load_recordings(path: Path) -> Iterator[Recording]:
    """A recording, or all recordings below a directory in the order of names, one after the other.

    Raises BadInput, naming the file: none there, damaged, truncated, too many.
    """
    files = sorted(path.rglob("*.mcap")) if path.is_dir() else [path]
    if not files:
        raise BadInput(f"{path}: no demonstrations there (no .mcap file); record some with `demonstrate`")
    steps = 0
    for file in files:
        recording = _read(file, MAX_STEPS - steps)
        steps += sum(len(demonstration.worlds) for demonstration in recording.demonstrations)
        yield recording


def _read(path: Path, allowed: int) -> Recording:
    file = McapFile(path)
    worlds: dict[tuple[int, int], World] = {}
    commands: dict[tuple[int, int], WheelCommand] = {}
    codecs: dict[str, MessageCodec[Any] | None] = {}
    for number, message in enumerate(file.messages()):
        if message.topic not in codecs:  # a topic may be described as late as where its first message is
            codecs[message.topic] = _codec(path, next(t for t in file.topics.values() if t.name == message.topic))
        codec = codecs[message.topic]
        if codec is None:
            continue
        try:
            decoded = codec.decode(message.data)
            if isinstance(decoded, World):
                worlds[decoded.episode, decoded.step] = _in_bounds(decoded, decoded[3:15], "a pose or velocity")
            else:
                commands[decoded.episode, decoded.step] = _in_bounds(decoded, decoded[3:5], "a wheel velocity")
        except Malformed as error:
            raise BadInput(f"{path}: message {number}, counted from 0: {error}") from None
        if len(worlds) > allowed:
            raise BadInput(
                f"{path}: more than {MAX_STEPS} steps, which would take over {MAX_STEPS * STEP_BYTES / 2**30:.1f} GiB of "
                "memory; give fewer recordings"
            )
    if file.damage.any:
        raise BadInput(
            f"{path}: truncated at byte {file.damage.cut_off_at}; record it again, or recover it with `recover`"
        )
    episodes: dict[int, list[tuple[World, WheelCommand]]] = {}
    for key in sorted(worlds.keys() & commands.keys()):
        episodes.setdefault(key[0], []).append((worlds[key], commands[key]))
    demonstrations = [
        Demonstration(tuple(world for world, _ in steps), tuple(command for _, command in steps))
        for steps in episodes.values()
    ]
    about = next((dict(values) for name, values in file.metadata.values() if name == RUN_RECORD), {})
    return Recording(path, about.pop(BEHAVIOR_KEY, ""), demonstrations, about)


def _codec(path: Path, topic: Topic) -> MessageCodec[Any] | None:
    """None for a topic that demonstrations do not need."""
    if TYPES.get(topic.type_name) not in (World, WheelCommand):
        return None
    if topic.kind[1:] != ("cdr", "ros2msg"):
        raise BadInput(f"{path}: topic {topic.name} is recorded as '{topic.message_encoding}'; only cdr is read")
    try:
        return MessageCodec(topic.type_name, topic.schema)
    except BadInput as error:
        raise BadInput(f"{path}: {topic.name}: {error}") from None


def _in_bounds[T](decoded: T, numbers: tuple[float, ...], what: str) -> T:
    if not isfinite(sum(numbers)):
        raise Malformed(f"{what} is not finite")
    if max(map(abs, numbers)) > MOST:
        raise Malformed(f"{what} is outside of +-{MOST:g}")
    return decoded
