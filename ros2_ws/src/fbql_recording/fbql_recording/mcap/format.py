"""The records of an MCAP file, parsed from bytes that are not trusted until they are checked.

Source: the MCAP specification, version 0. The records themselves are those of the `mcap` package; its readers can't
continue after a damaged record, which is why the file's outermost structure is read here.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from io import BytesIO
from struct import Struct
from typing import Any, BinaryIO, NamedTuple

import lz4.frame
import zstandard
from mcap.data_stream import ReadDataStream, RecordBuilder
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    ChunkIndex,
    Header,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)
from mcap.writer import MCAP0_MAGIC

MAX_RECORD_BYTES = 64 * 2**20
"""Largest record, and largest uncompressed chunk, that is read."""
HEAD = Struct("<BQ")
"""opcode, length"""
MESSAGE_BYTES = 22
"""The fields before the data in a message's body."""
CODECS = ("", "zstd", "lz4")
"""How chunks may be compressed."""
PROFILES = ("ros2", "")
"""Profiles of recordings of ROS 2."""
FIRST_PRIVATE = 0x80
"""Opcodes from here on are private; a reader skips such records."""

_MESSAGE_RECORD = Struct("<BQHIQQ")
"""opcode, length, channel id, sequence, log time, publish time"""
_CHUNK = Struct("<QQQII")
"""start, end, uncompressed size, CRC of the uncompressed records, length of the compression's name"""
_FOOTER = Struct("<BQQQI")
"""opcode, length, start of the summary, start of the summary offsets, CRC of the summary"""
FOOTER_BYTES = _FOOTER.size + len(MCAP0_MAGIC)
"""The footer and the magic after it, which end every complete file."""
_RECORDS: dict[int, Any] = {
    Opcode.HEADER: Header,
    Opcode.SCHEMA: Schema,
    Opcode.CHANNEL: Channel,
    Opcode.ATTACHMENT: Attachment,
    Opcode.METADATA: Metadata,
    Opcode.STATISTICS: Statistics,
    Opcode.CHUNK_INDEX: ChunkIndex,
    Opcode.ATTACHMENT_INDEX: AttachmentIndex,
    Opcode.METADATA_INDEX: MetadataIndex,
    Opcode.SUMMARY_OFFSET: SummaryOffset,
}
_FIELDS = {
    Opcode.HEADER: "ss",
    Opcode.SCHEMA: "2sss",
    Opcode.CHANNEL: "22sss",
    Opcode.CHUNK: "8884sS",
    Opcode.MESSAGE_INDEX: "2s",
    Opcode.ATTACHMENT: "88ssS4",
    Opcode.METADATA: "ss",
    Opcode.DATA_END: "4",
}
"""Fields of the records of the data section: the size of a number in bytes; s, S: bytes preceded by their length, in 4
or 8 bytes."""


class Damaged(ValueError):
    """Bytes that are not the valid record that they should be; the text states why."""


class Chunk(NamedTuple):
    """A chunk, still compressed."""

    start_ns: int
    """Smallest log time [ns], as the chunk states it: no CRC covers it."""
    end_ns: int
    """Largest log time [ns]."""
    size: int
    """Of the uncompressed records [bytes]."""
    crc: int
    """Of the uncompressed records; 0: none."""
    codec: str
    """One of CODECS, where it can be read."""
    packed: bytes


@dataclass
class McapSummary:
    """The content of the summary of an MCAP file; records of the data section by the byte where each begins."""

    start: int = 0
    """Its first byte."""
    has_crc: bool = False
    """Whether a CRC covers it (it matches)."""
    schemas: list[Schema] = field(default_factory=list[Schema])
    channels: list[Channel] = field(default_factory=list[Channel])
    statistics: Statistics | None = None
    chunks: dict[int, ChunkIndex] = field(default_factory=dict[int, ChunkIndex])
    attachments: dict[int, AttachmentIndex] = field(default_factory=dict[int, AttachmentIndex])
    metadata: dict[int, MetadataIndex] = field(default_factory=dict[int, MetadataIndex])

    @property
    def lists_messages(self) -> bool:
        """Whether it tells how many messages there were. A writer may leave out any part of a summary, or all of it."""
        has_counts = bool(self.chunks) and all(index.message_index_offsets for index in self.chunks.values())
        return self.statistics is not None or has_counts


def read_summary(file: BinaryIO, size: int) -> McapSummary | None:
    """The summary of a file of `size` bytes; None if it has none.

    Raises:
        Damaged: its CRC does not match, or it is not a summary.
    """
    footer_at = size - FOOTER_BYTES
    if footer_at < len(MCAP0_MAGIC):
        raise Damaged("its footer is missing")
    file.seek(footer_at)
    footer = file.read(_FOOTER.size)
    opcode, length, start, _, _ = _FOOTER.unpack(footer)
    if (opcode, length) != (Opcode.FOOTER, 20):
        raise Damaged("its footer is damaged")
    if start == 0:
        return None
    if not len(MCAP0_MAGIC) <= start <= footer_at:
        raise Damaged("its footer is damaged")
    if footer_at - start > MAX_RECORD_BYTES:
        raise Damaged(f"its summary is larger than {MAX_RECORD_BYTES >> 20} MiB")
    return summary_between(file, start, size)


def summary_between(file: BinaryIO, start: int, size: int) -> McapSummary:
    """The summary that begins at a byte of a file of `size` bytes, wherever its footer says that it begins.

    Raises:
        Damaged: its CRC does not match, or it is not a summary.
    """
    file.seek(start)
    data = file.read(size - FOOTER_BYTES - start)
    footer = file.read(_FOOTER.size)
    crc = _FOOTER.unpack(footer)[-1]
    if crc and zlib.crc32(data + footer[:-4]) != crc:
        raise Damaged("the CRC of its summary does not match")
    summary = McapSummary(start, crc != 0)
    for _ in messages_in(data, lambda opcode, body: _add(summary, opcode, body)):
        pass
    return summary


def _add(summary: McapSummary, opcode: int, body: bytes) -> None:
    record = parse(opcode, body) if opcode in _RECORDS else None
    if isinstance(record, Schema):
        summary.schemas.append(record)
    elif isinstance(record, Channel):
        summary.channels.append(record)
    elif isinstance(record, Statistics):
        summary.statistics = record
    elif isinstance(record, ChunkIndex):
        summary.chunks[record.chunk_start_offset] = record
    elif isinstance(record, AttachmentIndex):
        summary.attachments[record.offset] = record
    elif isinstance(record, MetadataIndex):
        summary.metadata[record.offset] = record


def parse(opcode: int, body: bytes) -> Any:
    """A record of the `mcap` package; its body consists of its fields to the last byte, and its CRC, if any, matches.

    Raises:
        Damaged: it is not such a record.
    """
    try:
        record = _RECORDS[opcode].read(ReadDataStream(BytesIO(body)))
        builder = RecordBuilder()
        record.write(builder)
    except (McapError, struct.error, UnicodeDecodeError, ValueError, OverflowError, KeyError) as error:
        raise Damaged(f"it is not a record of kind {opcode}") from error
    written = builder.end()[HEAD.size :]
    if opcode == Opcode.ATTACHMENT and written[:-4] == body[:-4]:
        if body[-4:] not in (written[-4:], bytes(4)):
            raise Damaged(f"the CRC of attachment {record.name} does not match")
    elif written != body:
        raise Damaged(f"it is not a record of kind {opcode}")
    return record


def length_by_fields(opcode: int, body: bytes) -> int | None:
    """The length of a record of the data section by the lengths in it; None if `body` is too short to tell."""
    at = 0
    try:
        for name in _FIELDS[Opcode(opcode)]:
            if name == "s":
                at += 4 + struct.unpack_from("<I", body, at)[0]
            elif name == "S":
                at += 8 + struct.unpack_from("<Q", body, at)[0]
            else:
                at += int(name)
    except (KeyError, ValueError, struct.error):
        return None
    return at


def fits(opcode: int, length: int, body: bytes) -> bool:
    """Whether the length of a record of the data section agrees with the lengths in it; `body` may lack its end."""
    if opcode == Opcode.MESSAGE_INDEX and length % 16 != 6:
        return False
    return length_by_fields(opcode, body) == length


def is_misnamed(body: bytes, *, follows_chunk: bool) -> bool:
    """Whether a message outside of chunks, or a private record, is, by its lengths, another record with a damaged
    opcode."""
    kinds = [kind for kind in _FIELDS if kind != Opcode.DATA_END and (follows_chunk or kind != Opcode.MESSAGE_INDEX)]
    return any(fits(kind, len(body), body) for kind in kinds)


def parse_chunk(body: bytes) -> Chunk:
    """A chunk from its record's body.

    Raises:
        Damaged: it is not a chunk.
    """
    try:
        start_ns, end_ns, size, crc, name_length = _CHUNK.unpack_from(body)
        begin = _CHUNK.size + name_length
        codec = body[_CHUNK.size : begin].decode()
        (packed_size,) = struct.unpack_from("<Q", body, begin)
    except (struct.error, UnicodeDecodeError):
        raise Damaged("its head is not that of a chunk") from None
    if begin + 8 + packed_size != len(body):
        raise Damaged("its sizes do not fit")
    return Chunk(start_ns, end_ns, size, crc, codec, body[begin + 8 :])


def unpack(chunk: Chunk) -> bytes:
    """The records of a chunk whose codec is known; at most a byte more than the size that it states is ever unpacked.

    Raises:
        Damaged: they can't be unpacked, or differ from the original ones.
    """
    data = chunk.packed
    try:
        if chunk.codec == "zstd":
            # The frame's own size is not believed: a small chunk may promise terabytes.
            with zstandard.ZstdDecompressor().stream_reader(chunk.packed) as reader:
                data = reader.read(chunk.size + 1)
        elif chunk.codec == "lz4":
            data = lz4.frame.LZ4FrameDecompressor().decompress(chunk.packed, max_length=chunk.size + 1)
    except (zstandard.ZstdError, RuntimeError, EOFError):
        raise Damaged("it can't be unpacked") from None
    if len(data) != chunk.size:
        raise Damaged(f"it unpacks to {len(data)} bytes instead of {chunk.size}")
    if chunk.crc and zlib.crc32(data) != chunk.crc:
        raise Damaged("its CRC does not match")
    return data


def messages_in(
    data: bytes, take_other: Callable[[int, bytes], None] = lambda _opcode, _body: None
) -> Iterator[tuple[int, int, int, int, int, int]]:
    """The messages among records that follow each other: those of a chunk, or one outside of chunks.

    Yields channel id, sequence, log time [ns], publish time [ns], and the first byte and the end of the message's data;
    one generator and one unpacking per message, because this dominates the cost of reading a recording.

    Args:
        data: the records.
        take_other: called with the opcode and body of each other record, in its place.

    Raises:
        Damaged: these are not records.
    """
    at, end, unpack, size, message = (
        0,
        len(data),
        _MESSAGE_RECORD.unpack_from,
        _MESSAGE_RECORD.size,
        int(Opcode.MESSAGE),
    )
    while at < end:
        if end - at >= size:
            opcode, length, channel, sequence, log_time_ns, publish_time_ns = unpack(data, at)
        elif end - at >= HEAD.size:
            (opcode, length), channel, sequence, log_time_ns, publish_time_ns = HEAD.unpack_from(data, at), 0, 0, 0, 0
        else:
            raise Damaged("its records are cut off")
        begin, at = at, at + HEAD.size + length
        if at > end or (opcode == message and at - begin < size):
            raise Damaged("its records are cut off")
        if opcode == message:
            yield channel, sequence, log_time_ns, publish_time_ns, begin + size, at
        else:
            take_other(opcode, data[begin + HEAD.size : at])


def data_crc(file: BinaryIO, end: int) -> int:
    """The CRC of a file's first `end` bytes."""
    crc = 0
    file.seek(0)
    while end > 0 and (data := file.read(min(end, 2**20))):
        crc = zlib.crc32(data, crc)
        end -= len(data)
    return crc
