"""The MCAP format's records: what their bytes look like, and how chunks are unpacked without believing what they claim.

Format: the MCAP specification, version 0.
"""

from __future__ import annotations

import struct
from struct import Struct
from typing import NamedTuple

import lz4.frame
import zstandard
from mcap.opcode import Opcode

MAX_RECORD_BYTES = 64 * 2**20
"""Largest record, and largest unpacked chunk, that is read."""
HEAD = Struct("<BQ")
"""opcode, length"""
MESSAGE = Struct("<HIQQ")
"""channel id, sequence, log time, publish time"""
CODECS = ("", "zstd", "lz4")
"""How chunks may be compressed."""
PROFILES = ("ros2", "")
"""Profiles of recordings of ROS 2."""

FIRST_PRIVATE = 0x80
"""From here on kinds of records are not the specification's, and their content is anything."""

_CHUNK = Struct("<QQQII")
"""start, end, unpacked size, CRC of the unpacked records, length of the compression's name"""
LAYOUTS = {
    Opcode.HEADER: "ss",
    Opcode.FOOTER: "8 8 4",
    Opcode.SCHEMA: "2 s s b",
    Opcode.CHANNEL: "2 2 s s m",
    Opcode.CHUNK: "8 8 8 4 s B",
    Opcode.MESSAGE_INDEX: "2 x",
    Opcode.CHUNK_INDEX: "8 8 8 8 c 8 s 8 8",
    Opcode.ATTACHMENT: "8 8 s s B 4",
    Opcode.ATTACHMENT_INDEX: "8 8 8 8 8 s s",
    Opcode.STATISTICS: "8 2 4 4 4 4 8 8 c",
    Opcode.METADATA: "s m",
    Opcode.METADATA_INDEX: "8 8 s",
    Opcode.SUMMARY_OFFSET: "1 8 8",
    Opcode.DATA_END: "4",
}
"""Fields of each kind of record: bytes of a number; s: text; b, B: bytes after a length of 4 or 8; m: map of texts;
x: entries of 16 bytes, c: entries of 10 bytes after their length."""
TELLING = tuple(kind for kind, layout in LAYOUTS.items() if set(layout) & set("sbBmxc"))
"""Kinds whose structure tells them from all others: it has lengths that have to fit."""
_ENTRY_BYTES = {"m": 1, "x": 16, "c": 10}


class ChunkHead(NamedTuple):
    """What a chunk says about itself."""

    start_ns: int
    end_ns: int
    size: int
    """Unpacked [bytes]."""
    crc: int
    """Of the unpacked records; 0: none."""
    codec: str
    begin: int
    """Where the packed records begin in the chunk's body."""
    packed_size: int


def chunk_head(body: bytes) -> ChunkHead:
    """The head of a chunk's body. Raises struct.error or UnicodeDecodeError where it is no such."""
    start_ns, end_ns, size, crc, name_length = _CHUNK.unpack_from(body)
    codec = body[_CHUNK.size : _CHUNK.size + name_length].decode()
    begin = _CHUNK.size + name_length + 8
    (packed_size,) = struct.unpack_from("<Q", body, begin - 8)
    return ChunkHead(start_ns, end_ns, size, crc, codec, begin, packed_size)


def unpacked(codec: str, packed: bytes, size: int) -> bytes:
    """The records of a chunk; never more than a byte beyond the size that is given.

    Raises:
        ValueError: they can't be unpacked.
    """
    try:
        if codec == "zstd":
            # The frame's own size is not believed: a small chunk may promise terabytes.
            with zstandard.ZstdDecompressor().stream_reader(packed) as reader:
                return reader.read(size + 1)
        if codec == "lz4":
            return lz4.frame.LZ4FrameDecompressor().decompress(packed, max_length=size + 1)
    except (zstandard.ZstdError, RuntimeError, EOFError) as error:
        raise ValueError(str(error)) from None
    return packed


def has_layout(opcode: int, data: bytes, begin: int, end: int) -> bool:
    """Whether a record's body, data[begin:end], consists of the fields of its kind, to the last byte.

    The end may lie beyond the data: what is in long fields is not looked at.
    """
    layout = LAYOUTS.get(Opcode(opcode)) if opcode in _OPCODES else None
    if layout is None:
        return False
    at = begin
    try:
        for field in layout.replace(" ", ""):
            if field.isdigit():
                at += int(field)
                continue
            wide = field == "B"
            (length,) = struct.unpack_from("<Q" if wide else "<I", data, at)
            at += 8 if wide else 4
            if at + length > end or length % _ENTRY_BYTES.get(field, 1):
                return False
            if field == "s":
                data[at : at + length].decode()
            elif field == "m" and not _is_map(data, at, at + length):
                return False
            at += length
    except (struct.error, UnicodeDecodeError):
        return False
    return at == end


def inner_length(opcode: int, data: bytes) -> int | None:
    """How long a chunk's or attachment's body is by the length of what is in it; `data` begins with the body."""
    at = 0
    try:
        for field in LAYOUTS[Opcode(opcode)].replace(" ", ""):
            if field == "B":
                at += 8 + struct.unpack_from("<Q", data, at)[0]
            elif field == "s":
                at += 4 + struct.unpack_from("<I", data, at)[0]
            else:
                at += int(field)
    except struct.error:
        return None
    return at


def _is_map(data: bytes, at: int, end: int) -> bool:
    """Whether data[at:end] is texts, two by two."""
    texts = 0
    while at < end:
        (length,) = struct.unpack_from("<I", data, at)
        at += 4 + length
        if at > end:
            return False
        data[at - length : at].decode()
        texts += 1
    return at == end and texts % 2 == 0


_OPCODES = frozenset(int(opcode) for opcode in LAYOUTS)
