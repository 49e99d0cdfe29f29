"""An MCAP file taken apart, changed where its meaning is, and put together again with every length, index and CRC right.

Damage that a CRC finds is what `mutated_recordings` makes; here the file is sound and what it says is odd.
"""

from __future__ import annotations

import random
import struct
import zlib
from collections.abc import Callable
from copy import copy
from dataclasses import dataclass, field, replace
from io import BytesIO
from typing import Any, NamedTuple

import lz4.frame
import zstandard
from fuzzing import odd_bytes, odd_number, odd_word
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Message,
    MessageIndex,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
)
from mcap.records import Chunk as ChunkRecord
from mcap.stream_reader import StreamReader, breakup_chunk
from mcap.writer import MCAP0_MAGIC

PACK: dict[str, Callable[[bytes], bytes]] = {
    "": bytes,
    "zstd": zstandard.ZstdCompressor().compress,
    "lz4": lz4.frame.compress,
}


@dataclass
class Chunk:
    """A chunk's records, and how they are stored."""

    records: list[McapRecord]
    codec: str = "zstd"
    has_crc: bool = True
    shift_ns: int = 0
    """How far its head's times are from those of its messages [ns]."""


@dataclass
class Contents:
    """What a file holds, in its order."""

    header: Header
    data: list[McapRecord | Chunk]
    """The data section but for message indexes, which follow from the chunks."""
    has_summary: bool = True
    has_statistics: bool = True
    has_crc: bool = True
    has_indexes: bool = True
    """Whether message indexes follow the chunks."""
    has_chunk_indexes: bool = True
    """Whether the summary has them."""
    statistics: dict[str, Any] = field(default_factory=dict[str, Any])
    """Fields of the statistics that are not so."""
    indexes: dict[type, dict[str, int]] = field(default_factory=dict[type, dict[str, int]])
    """By kind of index in the summary: fields of the last of them that are not so."""


class Told(NamedTuple):
    """A message that the file holds; its numbers but for the sequence, which recovery may count anew."""

    topic: str
    log_time_ns: int
    publish_time_ns: int
    data: bytes


def contents_of(data: bytes) -> Contents:
    """Takes a sound file apart."""
    header = Header("", "")
    parts: list[McapRecord | Chunk] = []
    for record in StreamReader(BytesIO(data), emit_chunks=True).records:
        if isinstance(record, DataEnd):
            break
        if isinstance(record, Header):
            header = record
        elif isinstance(record, ChunkRecord):
            parts.append(Chunk(breakup_chunk(record), record.compression))
        elif not isinstance(record, MessageIndex):
            parts.append(record)
    return Contents(header, parts)


def messages_of(contents: Contents) -> list[Message]:
    """Every message, in the order of the file."""
    return [record for record in records_of(contents) if isinstance(record, Message)]


def records_of(contents: Contents) -> list[McapRecord]:
    """Every record, those of chunks in their places."""
    found: list[McapRecord] = []
    for part in contents.data:
        found += part.records if isinstance(part, Chunk) else [part]
    return found


def told_by(contents: Contents) -> list[Told]:
    """Every message whose channel is described, once, anywhere in the file."""
    channels: dict[int, set[str]] = {}
    for record in records_of(contents):
        if isinstance(record, Channel):
            channels.setdefault(record.id, set()).add(record.topic)
    return [
        Told(min(channels[each.channel_id]), each.log_time, each.publish_time, each.data)
        for each in messages_of(contents)
        if len(channels.get(each.channel_id, ())) == 1
    ]


# Put together


def _bytes_of(record: McapRecord) -> bytes:
    builder = RecordBuilder()
    record.write(builder)
    return builder.end()


def _packed(chunk: Chunk) -> tuple[ChunkRecord, list[MessageIndex]]:
    data = b""
    indexes: dict[int, MessageIndex] = {}
    for record in chunk.records:
        if isinstance(record, Message):
            index = indexes.setdefault(record.channel_id, MessageIndex(record.channel_id, []))
            index.records.append((record.log_time, len(data)))
        data += _bytes_of(record)
    times = [record.log_time for record in chunk.records if isinstance(record, Message)] or [0]
    start, end = (max(0, min(time + chunk.shift_ns, 2**64 - 1)) for time in (min(times), max(times)))
    crc = zlib.crc32(data) if chunk.has_crc else 0
    packed = PACK[chunk.codec](data) if chunk.codec in PACK else data
    return ChunkRecord(chunk.codec, packed, end, start, crc, len(data)), list(indexes.values())


def bytes_of(contents: Contents) -> bytes:
    """The file. Raises struct.error and the like for a number that no field takes."""
    out = bytearray(MCAP0_MAGIC + _bytes_of(contents.header))
    chunks: list[ChunkIndex] = []
    attachments: list[AttachmentIndex] = []
    metadata: list[MetadataIndex] = []
    for part in contents.data:
        at = len(out)
        if isinstance(part, Chunk):
            record, indexes = _packed(part)
            out += _bytes_of(record)
            end = len(out)
            offsets: dict[int, int] = {}
            for index in indexes if contents.has_indexes else ():
                offsets[index.channel_id] = len(out)
                out += _bytes_of(index)
            chunks.append(
                ChunkIndex(
                    chunk_length=end - at,
                    chunk_start_offset=at,
                    compression=record.compression,
                    compressed_size=len(record.data),
                    message_end_time=record.message_end_time,
                    message_index_length=len(out) - end,
                    message_index_offsets=offsets,
                    message_start_time=record.message_start_time,
                    uncompressed_size=record.uncompressed_size,
                )
            )
            continue
        out += _bytes_of(part)
        size = len(out) - at
        if isinstance(part, Attachment):
            attachments.append(
                AttachmentIndex(at, size, part.log_time, part.create_time, len(part.data), part.name, part.media_type)
            )
        elif isinstance(part, Metadata):
            metadata.append(MetadataIndex(at, size, part.name))
    out += _bytes_of(DataEnd(zlib.crc32(out) if contents.has_crc else 0))
    start = len(out)
    summary = b""
    if contents.has_summary:
        described = _described(contents)
        for found in (chunks, attachments, metadata):
            for name, value in contents.indexes.get(type(found[-1]) if found else type(None), {}).items():
                setattr(found[-1], name, value)
        lists: list[McapRecord] = [*described, *chunks * contents.has_chunk_indexes, *attachments, *metadata]
        if contents.has_statistics:
            lists.insert(0, _statistics(contents, len(chunks), len(attachments), len(metadata)))
        summary = b"".join(map(_bytes_of, lists))
    begin = start if summary else 0
    footer = struct.pack("<BQQQ", Opcode.FOOTER, 20, begin, 0)
    crc = zlib.crc32(summary + footer) if contents.has_crc else 0
    footer = _bytes_of(Footer(begin, 0, crc))
    return bytes(out + summary + footer + MCAP0_MAGIC)


def _described(contents: Contents) -> list[McapRecord]:
    """The first copy of every schema and channel."""
    found: dict[tuple[type, int], McapRecord] = {}
    for record in records_of(contents):
        if isinstance(record, Schema | Channel):
            found.setdefault((type(record), record.id), record)
    return sorted(found.values(), key=lambda record: isinstance(record, Channel))


def _statistics(contents: Contents, chunks: int, attachments: int, metadata: int) -> Statistics:
    counts: dict[int, int] = {}
    messages = messages_of(contents)
    for message in messages:
        counts[message.channel_id] = counts.get(message.channel_id, 0) + 1
    times = [message.log_time for message in messages] or [0]
    described = _described(contents)
    values = {
        "attachment_count": attachments,
        "channel_count": sum(isinstance(record, Channel) for record in described),
        "channel_message_counts": counts,
        "chunk_count": chunks,
        "message_count": len(messages),
        "message_end_time": max(times),
        "message_start_time": min(times),
        "metadata_count": metadata,
        "schema_count": sum(isinstance(record, Schema) for record in described),
    }
    return Statistics(**{**values, **contents.statistics})


# Changed: each function changes the contents in place


def _copy[R: McapRecord | Chunk](part: R) -> R:
    """A copy that can be changed: no field of a record is changed in its place."""
    return replace(part, records=[*map(copy, part.records)]) if isinstance(part, Chunk) else copy(part)


def _one[T](rng: random.Random, values: list[T]) -> T | None:
    return rng.choice(values) if values else None


def _chunks(contents: Contents) -> list[Chunk]:
    return [part for part in contents.data if isinstance(part, Chunk)]


def _holder(rng: random.Random, contents: Contents) -> list[Any]:
    """The records of a chunk, or of the data section."""
    return rng.choice([contents.data, *(chunk.records for chunk in _chunks(contents))])


def odd_cdr(rng: random.Random, data: bytes) -> bytes:
    """A message's data with a field changed: a number of its width, a length, a truth value, a text, an end."""
    if len(data) < 12 or rng.random() < 0.15:
        return rng.choice((b"", data[: rng.randrange(len(data) + 1)], data + rng.randbytes(rng.choice((1, 4, 8, 100)))))
    if rng.random() < 0.1:
        return rng.choice((b"\0\0", b"\0\1", b"\0\3", b"\0\7", b"\0\x0b")) + data[2:]  # encapsulation
    size = rng.choice((1, 4, 8, 8))
    at = 4 + rng.randrange(max(1, (len(data) - 4) // size)) * size
    if size == 8:
        number = rng.choice((0.0, -0.0, 1e308, -1e308, 1e-308, float("nan"), float("inf"), -1.0, 1e5, 3.5))
        value = rng.choice((struct.pack("<d", number), struct.pack("<Q", odd_number(rng) & (2**64 - 1))))
    else:
        value = (odd_number(rng) & (2 ** (8 * size) - 1)).to_bytes(size, "little")
    return data[:at] + value[: len(data) - at] + data[at + size :]


def _message(rng: random.Random, contents: Contents) -> None:
    message = _one(rng, messages_of(contents))
    if message is None:
        return
    how = rng.randrange(6)
    if how == 0:
        message.log_time = odd_number(rng) & (2**64 - 1)
    elif how == 1:
        message.publish_time = odd_number(rng) & (2**64 - 1)
    elif how == 2:
        message.sequence = odd_number(rng) & (2**32 - 1)
    elif how == 3:
        message.channel_id = rng.choice(messages_of(contents)).channel_id
    elif how == 4:
        message.channel_id = odd_number(rng) & 0xFFFF
    else:
        message.data = rng.choice(messages_of(contents)).data


def _cdr(rng: random.Random, contents: Contents) -> None:
    """Some messages, or all of a channel."""
    messages = messages_of(contents)
    if not messages:
        return
    channel = rng.choice(messages).channel_id
    share = rng.choice((0.02, 0.3, 1.0))
    seed = rng.random()
    for message in messages:
        if message.channel_id == channel and rng.random() < share:
            message.data = odd_cdr(random.Random(seed) if share == 1.0 else rng, message.data)


def _order(rng: random.Random, contents: Contents) -> None:
    """Records removed, doubled, moved, in another order, in another chunk."""
    records = _holder(rng, contents)
    if not records:
        return
    first, second = sorted(rng.randrange(len(records) + 1) for _ in range(2))
    part = records[first:second]
    how = rng.randrange(5)
    if how == 0:
        del records[first:second]
    elif how == 1:
        records[second:second] = map(_copy, part)
    elif how == 2:
        records[first:second] = part[::-1]
    elif how == 3:
        rng.shuffle(part)
        records[first:second] = part
    else:
        del records[first:second]
        other = _holder(rng, contents)
        if other is not contents.data and any(isinstance(each, Chunk) for each in part):
            other = contents.data
        place = rng.randrange(len(other) + 1)
        other[place:place] = part


def _storage(rng: random.Random, contents: Contents) -> None:
    """How a chunk is stored: its compression, CRC, times; two as one, one as two, an empty one, nothing in chunks."""
    chunk = _one(rng, _chunks(contents))
    if chunk is None:
        return
    at = next(place for place, part in enumerate(contents.data) if part is chunk)
    how = rng.randrange(7)
    if how == 0:
        chunk.codec = rng.choice((*PACK, "", "brotli", odd_word(rng)))
    elif how == 1:
        chunk.has_crc = False
    elif how == 2:
        chunk.shift_ns = rng.choice((-1, 1, 10**9, -(2**63), 2**63, 2**64))
    elif how == 3:
        middle = rng.randrange(len(chunk.records) + 1)
        contents.data[at : at + 1] = [
            replace(chunk, records=part) for part in (chunk.records[:middle], chunk.records[middle:])
        ]
    elif how == 4:
        contents.data.insert(at, Chunk([]))
    elif how == 5:
        contents.data[at : at + 1] = chunk.records
    else:
        contents.data.append(contents.data.pop(at))


def _description(rng: random.Random, contents: Contents) -> None:
    """A schema or channel says something else, in one place or in all, or comes twice."""
    described = [record for record in records_of(contents) if isinstance(record, Schema | Channel)]
    record = _one(rng, described)
    if record is None:
        return
    same = [each for each in described if type(each) is type(record) and each.id == record.id]
    changes: dict[str, Any] = {}
    other = rng.choice(described)
    if isinstance(record, Schema):
        name = rng.choice(("name", "encoding", "data", "data", "id"))
        changes[name] = {
            "name": rng.choice((odd_word(rng), "this/msg/Zen", "std_msgs/msg/String", getattr(other, "name", "a/b"))),
            "encoding": rng.choice(("", "ros2idl", "ros1msg", "protobuf", "jsonschema", odd_word(rng))),
            "data": odd_schema(rng, record.data),
            "id": rng.choice((0, 1, 2, 65535, other.id)),
        }[name]
    else:
        name = rng.choice(("topic", "message_encoding", "metadata", "schema_id", "id"))
        qos = rng.choice(("[" * 5000, "- depth: !!int ''", "[]", "null", odd_word(rng)))
        changes[name] = {
            "topic": rng.choice(
                (odd_word(rng), "/world", "world", "/behaviors/", "/a b", getattr(other, "topic", "/x"))
            ),
            "message_encoding": rng.choice(("", "json", "ros1", "CDR", odd_word(rng))),
            "metadata": rng.choice(
                ({}, {"offered_qos_profiles": qos}, {"topic_type_hash": odd_word(rng)}, {odd_word(rng): ""})
            ),
            "schema_id": rng.choice((0, 1, 65535, other.id)),
            "id": rng.choice((0, 1, 65535, other.id)),
        }[name]
    if rng.random() < 0.3:
        _holder(rng, contents).insert(0, replace(record, **changes))
        return
    for each in same if rng.random() < 0.7 else [record]:
        for name, value in changes.items():
            setattr(each, name, value)


def odd_schema(rng: random.Random, data: bytes) -> bytes:
    """The text of a message definition with lines of it changed, or with a syntax that takes long or never ends."""
    if rng.random() < 0.4:
        return odd_bytes(data, rng, b"float64[] int64[9] string<=5 # = MSG: a/B \n" + b"=" * 80)
    lines = data.split(b"\n")
    at = rng.randrange(len(lines))
    kind = rng.choice(
        (b"float64", b"bool", b"string", b"wstring", b"int8", b"std_msgs/Header", b"Own", b"time", b"x/Y")
    )
    array = rng.choice(
        (b"", b"[]", b"[3]", b"[0]", b"[4096]", b"[<=4]", b"[" + b"9" * 30 + b"]", b"[" + b"9" * 5000 + b"]")
    )
    line = kind + array + b" " + rng.choice((b"a", b"header", b"step", b"names", b"9", b"a" * 300, "é".encode()))
    how = rng.randrange(4)
    if how == 0:
        lines[at] = line
    elif how == 1:
        lines.insert(at, line)
    elif how == 2:
        lines.insert(rng.randrange(len(lines)), lines.pop(at))
    else:
        lines[at:] = [
            line,
            b"=" * 80,
            b"MSG: " + rng.choice((b"a/Own", b"fbql_msgs/Own", b"x/Y", b"")),
            b"Own[4096] next",
        ]
    return b"\n".join(lines)


def _aside(rng: random.Random, contents: Contents) -> None:
    """An attachment or Metadata record says something else, or one more of it."""
    aside = [record for record in contents.data if isinstance(record, Attachment | Metadata)]
    record = _one(rng, aside)
    if record is None:
        return
    if rng.random() < 0.3:
        record = copy(record)
        contents.data.insert(rng.randrange(len(contents.data) + 1), record)
    if isinstance(record, Attachment):
        how = rng.randrange(4)
        if how == 0:
            record.name = rng.choice((odd_word(rng), "config.yaml", "episodes.csv", "trees/x.json", "policy.npz"))
        elif how == 1:
            record.media_type = odd_word(rng)
        else:
            record.data = odd_bytes(record.data, rng, b"&a *a [] {} : !!int nan -1 999999999999999999999 ,\n")
    elif rng.random() < 0.3 or not record.metadata:
        record.name = rng.choice(("fbql", "fbql_restart", "fbql_gap", "fbql_recovery", "rosbag2", odd_word(rng)))
    else:
        name = rng.choice(list(record.metadata))
        record.metadata = {**record.metadata, rng.choice((name, odd_word(rng))): odd_word(rng)}


def _ends(rng: random.Random, contents: Contents) -> None:
    """What the header and the summary say."""
    how = rng.randrange(7)
    if how == 6:
        kind = rng.choice((ChunkIndex, AttachmentIndex, MetadataIndex))
        at, size = ("chunk_start_offset", "chunk_length") if kind is ChunkIndex else ("offset", "length")
        contents.indexes[kind] = {rng.choice((at, size)): odd_number(rng) & (2**64 - 1)}
    elif how == 0:
        contents.header.profile = rng.choice(("", "ros1", odd_word(rng)))
    elif how == 1:
        contents.header.library = odd_word(rng)
    elif how == 2:
        contents.has_summary = False
    elif how == 3:
        contents.has_statistics = False
    elif how == 4:
        name = rng.choice(("has_crc", "has_indexes", "has_chunk_indexes"))
        setattr(contents, name, False)
    else:
        name = rng.choice(("message_count", "chunk_count", "message_start_time", "message_end_time", "channel_count"))
        contents.statistics[name] = odd_number(rng) & (2 ** (64 if name.startswith("message") else 32) - 1)
        if rng.random() < 0.5:
            counts = {message.channel_id: rng.choice((0, 1, 2**64 - 1)) for message in messages_of(contents)}
            contents.statistics["channel_message_counts"] = counts


CHANGES = (_message, _message, _cdr, _cdr, _cdr, _order, _order, _storage, _description, _description, _aside, _ends)


def odd_contents(contents: Contents, rng: random.Random) -> tuple[str, Contents, bytes]:
    """One to four changes: what they are, what the file holds now, and the file."""
    odd = replace(contents, data=[*map(_copy, contents.data)], header=copy(contents.header), statistics={}, indexes={})
    names: list[str] = []
    for _ in range(rng.choice((1, 1, 2, 4))):
        change = rng.choice(CHANGES)
        change(rng, odd)
        names.append(change.__name__.lstrip("_"))
    return ", ".join(names), odd, bytes_of(odd)
