"""Limits for the library `rosbags`, which trusts the contents of a bag: one of a few KB must not take all memory, or never end.

A YAML text is read as plain data, chunks and messages are unpacked up to a limit, and a message type has only so many parts.
A schema that the library can't read leaves its topic without a definition, which matters only if the topic is asked for.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace
from typing import Any, BinaryIO
from urllib.parse import quote

import zstandard
from fbql_common.core.errors import BadInput
from fbql_recording.mcap.format import MAX_RECORD_BYTES, Chunk, unpack
from fbql_recording.plain_yaml import from_yaml
from mcap.records import Chunk as ChunkRecord
from mcap.stream_reader import StreamReader

MOST_PARTS = 100_000
"""The most messages nested in one of a fixed size; the library generates code for each."""


@cache
def set_limits() -> None:
    """Replaces the library's readers, which have no limits, by ours. The library must be installed."""
    reader, metadata, storage, database = (
        import_module(f"rosbags.rosbag2.{name}") for name in ("reader", "metadata", "storage_mcap", "storage_sqlite3")
    )
    any_reader, typesys = import_module("rosbags.highlevel.anyreader"), import_module("rosbags.typesys")
    not_yaml = reader.YAMLError

    class PlainYaml(reader.YAML):
        """Reads plain data only."""

        def load(self, stream: str) -> Any:
            try:
                return from_yaml(stream, "YAML")
            except BadInput as error:
                raise not_yaml(str(error)) from None

    reader.YAML = metadata.YAML = PlainYaml
    reader.zstd = SimpleNamespace(open=reader.zstd.open, decompress=_message)
    storage.DECOMPRESSORS.update({codec: _records_by(codec) for codec in ("zstd", "lz4")})
    # A schema that is not ROS's, as protobuf's bytes, and one that can't be parsed.
    storage.read_string = lambda file: storage.read_bytes(file).decode(errors="surrogateescape")
    storage.get_msgdef = _or(storage.get_msgdef(None), storage.get_msgdef, KeyError)
    for name in ("get_types_from_msg", "get_types_from_idl"):
        setattr(any_reader, name, _or({}, getattr(any_reader, name), typesys.TypesysError))

    class Database(database.Sqlite3Reader):
        """Opens a file of any name."""

        def __init__(self, path: Path) -> None:
            super().__init__(_InUri(path))

    for kind, name in ((reader.DirectoryReader, "sqlite3"), (reader.Reader, ".db3")):
        kind.STORAGE_PLUGINS = {**kind.STORAGE_PLUGINS, name: Database}


class _InUri(type(Path())):
    """A path that the library writes into a URI, where # and ? have a meaning."""

    def __format__(self, _: str) -> str:
        return quote(str(self))


def _or[T](instead: T, function: Callable[..., T], error: type[Exception]) -> Callable[..., T]:
    def call(*arguments: Any) -> T:
        try:
            return function(*arguments)
        except error:
            return instead

    return call


def check_mcap(file: BinaryIO) -> None:
    """Reads an MCAP file with its checksums, which the library ignores. Raises what the mcap package raises, or
    ValueError."""
    reader = StreamReader(file, emit_chunks=True, validate_crcs=True, record_size_limit=MAX_RECORD_BYTES)
    for record in reader.records:
        if isinstance(record, ChunkRecord):
            _records(record.compression, record.data, record.uncompressed_size, record.uncompressed_crc)


def check_type(definitions: Any, name: str) -> None:
    """Raises BadInput for a message type that is not defined, or has too many parts. `definitions`: the fields of each type."""
    parts: dict[str, int] = {}

    def count(name: str) -> int:
        if name not in definitions:
            raise BadInput(f"message type {name} has no ROS definition in this bag")
        if name not in parts:
            parts[name] = min(MOST_PARTS + 1, 1 + sum(of_field(kind) for _, kind in definitions[name][1]))
        return parts[name]

    def of_field(kind: Any) -> int:
        shape, what = kind
        if shape.name == "NAME":
            return count(what)
        if shape.name == "ARRAY":
            (inner, named), length = what
            return length * (count(named) if inner.name == "NAME" else named[0] == "string")
        return 0

    if count(name) > MOST_PARTS:
        raise BadInput(f"a message of type {name} has more than {MOST_PARTS} parts")


def _records_by(codec: str) -> Any:
    return lambda packed, size: _records(codec, packed, size)


def _records(codec: str, packed: bytes, size: int, crc: int = 0) -> bytes:
    """The records of a chunk."""
    if size > MAX_RECORD_BYTES:
        raise BadInput(f"a chunk of {size} bytes; at most {MAX_RECORD_BYTES >> 20} MiB are read")
    return unpack(Chunk(0, 0, size, crc, codec, packed))


def _message(packed: bytes) -> bytes:
    """A message that is compressed on its own."""
    with zstandard.ZstdDecompressor().stream_reader(packed) as reader:
        data = reader.read(MAX_RECORD_BYTES + 1)
    if len(data) > MAX_RECORD_BYTES:
        raise BadInput(f"a message of more than {MAX_RECORD_BYTES >> 20} MiB")
    return data
