"""The summary of an MCAP file, where its CRC says that it is sound: what the whole file held."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable
from dataclasses import dataclass, field
from io import BytesIO

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import AttachmentIndex, Channel, ChunkIndex, MetadataIndex, Schema, Statistics
from mcap.writer import MCAP0_MAGIC

from fbql_recording.mcap.format import HEAD, MAX_RECORD_BYTES, has_layout

Read = Callable[[int, int], bytes]
"""The bytes of a file: from where, at most how many."""
_FOOTER_BYTES = HEAD.size + 20
"""The footer's record; the magic follows it."""


@dataclass
class SoundSummary:
    """What a sound summary says."""

    schemas: list[Schema] = field(default_factory=list[Schema])
    channels: list[Channel] = field(default_factory=list[Channel])
    statistics: Statistics | None = None
    chunks: dict[int, ChunkIndex] = field(default_factory=dict[int, ChunkIndex])
    """By the byte where each begins; so are the next two."""
    attachments: dict[int, AttachmentIndex] = field(default_factory=dict[int, AttachmentIndex])
    metadata: dict[int, MetadataIndex] = field(default_factory=dict[int, MetadataIndex])


def sound_summary(read: Read, size: int) -> SoundSummary | None:
    """The summary of a file of `size` bytes; None where there is none, or nothing says that it is sound."""
    footer_at = size - len(MCAP0_MAGIC) - _FOOTER_BYTES
    if footer_at < len(MCAP0_MAGIC):
        return None
    tail = read(footer_at, _FOOTER_BYTES)
    opcode, length, start, _, crc = struct.unpack("<BQQQI", tail)
    is_footer = (opcode, length) == (Opcode.FOOTER, 20) and crc != 0
    if not (is_footer and len(MCAP0_MAGIC) <= start <= footer_at and footer_at - start <= MAX_RECORD_BYTES):
        return None
    data = read(start, footer_at - start)
    if zlib.crc32(data + tail[:-4]) != crc:
        return None
    found = SoundSummary()
    at = 0
    while at + HEAD.size <= len(data):
        opcode, length = HEAD.unpack_from(data, at)
        begin, at = at + HEAD.size, at + HEAD.size + length
        if at <= len(data) and has_layout(opcode, data, begin, at):
            _take(found, opcode, data[begin:at])
    return found


def _take(found: SoundSummary, opcode: int, body: bytes) -> None:
    stream = ReadDataStream(BytesIO(body))
    if opcode == Opcode.SCHEMA:
        found.schemas.append(Schema.read(stream))
    elif opcode == Opcode.CHANNEL:
        found.channels.append(Channel.read(stream))
    elif opcode == Opcode.STATISTICS:
        found.statistics = Statistics.read(stream)
    elif opcode == Opcode.CHUNK_INDEX:
        chunk = ChunkIndex.read(stream)
        found.chunks[chunk.chunk_start_offset] = chunk
    elif opcode == Opcode.ATTACHMENT_INDEX:
        attachment = AttachmentIndex.read(stream)
        found.attachments[attachment.offset] = attachment
    elif opcode == Opcode.METADATA_INDEX:
        metadata = MetadataIndex.read(stream)
        found.metadata[metadata.offset] = metadata
