"""Demonstrations as files: MCAP recordings of what the simulator showed and what the instructor commanded.

A recording holds two topics, `world` (fbql_msgs/WorldState) and `wheel_command` (fbql_msgs/WheelCommand), as CDR with
their ros2msg schemas, and a Metadata record `fbql` whose entry `behavior` names the behavior. One episode is one
demonstration; a command belongs to the world state of its (episode, step). It is a directory that `ros2 bag` accepts.

Only whole recordings are read: a damaged or truncated one is refused with the reason.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from struct import error as StructError  # noqa: N812
from typing import IO, NamedTuple

from fbql_common.core.errors import BadInput
from fbql_common.core.types import WheelCommand, World
from fbql_common.wire import Rejected, decode_command, decode_world, type_name
from mcap.exceptions import EndOfFile, InvalidMagic, McapError
from mcap.records import Channel, Chunk, McapRecord, Message, Metadata, Schema
from mcap.stream_reader import CRCValidationError, StreamReader, breakup_chunk
from zstandard import ZstdError

from fbql_behaviors.core.patterns import Demonstration

METADATA_NAME = "fbql"
BEHAVIOR_KEY = "behavior"
MAX_STEPS = 1_000_000
"""Steps that are read at most."""
STEP_BYTES = 1024
"""Memory that a step takes, about [bytes]."""
MAX_RECORD_BYTES = 64 * 2**20


class Recording(NamedTuple):
    """The demonstrations of one behavior in one file."""

    file: Path
    behavior: str
    """Name of the behavior; empty when the file does not say."""
    demonstrations: list[Demonstration]
    about: dict[str, str]
    """What else the file's Metadata record `fbql` says, such as who demonstrated."""


def load_demonstrations(path: Path, behavior: str) -> list[Demonstration]:
    """The demonstrations of a behavior in a recording, or in all recordings below a directory, in the order of names.

    Raises BadInput, naming the file: none there, of another behavior, damaged, truncated, too many.
    """
    found: list[Demonstration] = []
    for recording in load_recordings(path):
        if recording.behavior != behavior:
            held = recording.behavior or "no behavior"
            raise BadInput(f"{recording.file}: holds demonstrations of '{held}', not of '{behavior}'")
        found += recording.demonstrations
    if not found:
        raise BadInput(f"{path}: the recordings hold no demonstration: no world state with its command")
    return found


def load_recordings(path: Path) -> Iterator[Recording]:
    """A recording, or all recordings below a directory in the order of names, one after the other.

    Raises BadInput, naming the file: none there, damaged, truncated, too many.
    """
    files = sorted(path.rglob("*.mcap")) if path.is_dir() else [path]
    if not files:
        raise BadInput(f"{path}: no demonstrations there (no .mcap file); record some with demonstrate.py")
    steps = 0
    for file in files:
        try:
            with file.open("rb") as stream:
                if not stream.peek(1):
                    raise BadInput("the file is empty")
                demonstrations, about = _read(stream, MAX_STEPS - steps)
        except OSError as error:
            raise BadInput(f"{file}: cannot be read ({error.strerror})") from None
        except BadInput as error:
            raise BadInput(f"{file}: {error}") from None
        except InvalidMagic:
            raise BadInput(f"{file}: not an MCAP recording") from None
        except EndOfFile:
            raise BadInput(f"{file}: truncated; record it again") from None
        except (McapError, CRCValidationError, ZstdError, StructError, UnicodeDecodeError) as error:
            raise BadInput(f"{file}: damaged ({error}); record it again") from None
        steps += sum(len(demonstration.worlds) for demonstration in demonstrations)
        yield Recording(file, about.pop(BEHAVIOR_KEY, ""), demonstrations, about)


def _read(stream: IO[bytes], allowed: int) -> tuple[list[Demonstration], dict[str, str]]:
    schemas: dict[int, str] = {}
    types: dict[int, str] = {}
    about: dict[str, str] = {}
    worlds: dict[tuple[int, int], World] = {}
    commands: dict[tuple[int, int], WheelCommand] = {}
    world_type, command_type = type_name(World), type_name(WheelCommand)
    messages = 0
    for record in _records(stream):
        if isinstance(record, Schema):
            schemas[record.id] = record.name
        elif isinstance(record, Channel):
            types[record.id] = schemas.get(record.schema_id, "")
        elif isinstance(record, Metadata) and record.name == METADATA_NAME:
            about = dict(record.metadata)
        elif isinstance(record, Message):
            kind = types.get(record.channel_id)
            if kind == world_type:
                world = _decoded(decode_world, record.data, messages)
                worlds[world.episode, world.step] = world
            elif kind == command_type:
                command = _decoded(decode_command, record.data, messages)
                commands[command.episode, command.step] = command
            messages += 1
            if len(worlds) > allowed:
                raise BadInput(
                    f"more than {MAX_STEPS} steps, which would take over {MAX_STEPS * STEP_BYTES / 2**30:.1f} GiB of memory; "
                    "give fewer recordings"
                )
    episodes: dict[int, list[tuple[World, WheelCommand]]] = {}
    for key in sorted(worlds.keys() & commands.keys()):
        episodes.setdefault(key[0], []).append((worlds[key], commands[key]))
    return [Demonstration(tuple(w for w, _ in steps), tuple(c for _, c in steps)) for steps in episodes.values()], about


def _decoded[T](decode: Callable[[bytes], T], data: bytes, number: int) -> T:
    try:
        return decode(data)
    except Rejected as error:
        raise BadInput(f"message {number}, counted from 0: {error}") from None


def _records(stream: IO[bytes]) -> Iterator[McapRecord]:
    """All records, those of chunks too, each chunk checked against its size limit and its CRC."""
    reader = StreamReader(stream, emit_chunks=True, validate_crcs=True, record_size_limit=MAX_RECORD_BYTES)
    for record in reader.records:
        if isinstance(record, Chunk):
            if record.uncompressed_size > MAX_RECORD_BYTES:
                raise BadInput(f"a chunk of {record.uncompressed_size} bytes; at most {MAX_RECORD_BYTES} are read")
            yield from breakup_chunk(record, validate_crc=True)
        else:
            yield record
