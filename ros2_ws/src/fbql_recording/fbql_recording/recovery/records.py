"""What is in the records of a damaged MCAP file, as far as a CRC says that it is sound."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from io import BytesIO
from typing import NamedTuple

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Schema

from fbql_recording.mcap.format import CODECS, HEAD, MAX_RECORD_BYTES, MESSAGE, chunk_head, has_layout, unpacked

_MESSAGE_BEGIN = struct.Struct("<HI")
"""channel id, sequence"""


class SoundMessage(NamedTuple):
    """A message that is as it was recorded."""

    channel: int
    sequence: int
    log_time_ns: int
    publish_time_ns: int
    data: bytes


class Tally:
    """The messages of one channel in one chunk."""

    __slots__ = ("count", "first", "last")

    def __init__(self, sequence: int, count: int = 0) -> None:
        self.count = count
        self.first = self.last = sequence
        """Their sequence numbers."""


def sound_chunk(body: bytes) -> tuple[str, bytes] | None:
    """What a chunk is really packed with, and its records; None where no reading of it is sound.

    Its size and the name of its compression may be what is damaged: its CRC tells.
    """
    head = chunk_head(body)
    packed = body[head.begin :]
    readings = [(head.codec, head.size)]
    if head.crc:
        readings += [(codec, size) for codec in CODECS for size in (head.size, MAX_RECORD_BYTES)]
    for codec, size in readings:
        if codec not in CODECS or size > MAX_RECORD_BYTES:
            continue
        try:
            data = unpacked(codec, packed, size)
        except ValueError:
            continue
        if len(data) <= size and (zlib.crc32(data) == head.crc if head.crc else len(data) == head.size):
            return codec, data
    return None


def is_sound_attachment(body: bytes) -> bool:
    """Whether the CRC of an attachment's body matches."""
    return len(body) >= 4 and body[-4:] == zlib.crc32(body[:-4]).to_bytes(4, "little")


def walk(data: bytes) -> tuple[dict[int, Tally], list[Schema | Channel]]:
    """How many messages of which channels a chunk has, and what it describes.

    Raises:
        struct.error, ValueError: these are no records.
    """
    tallies: dict[int, Tally] = {}
    descriptions: list[Schema | Channel] = []
    offset, end = 0, len(data)
    head, unpack, message_op = HEAD.unpack_from, _MESSAGE_BEGIN.unpack_from, int(Opcode.MESSAGE)
    while offset < end:
        opcode, length = head(data, offset)
        begin, offset = offset + 9, offset + 9 + length
        if offset > end:
            raise ValueError("a record is cut off")
        if opcode == message_op:
            if length < MESSAGE.size:
                raise ValueError("a message is too short")
            channel, sequence = unpack(data, begin)
            tally = tallies.get(channel)
            if tally is None:
                tally = tallies[channel] = Tally(sequence)
            tally.count += 1
            tally.last = sequence
        elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            if not has_layout(opcode, data, begin, offset):
                raise ValueError("a description is damaged")
            stream = ReadDataStream(BytesIO(data[begin:offset]))
            descriptions.append(Schema.read(stream) if opcode == Opcode.SCHEMA else Channel.read(stream))
    return tallies, descriptions


def messages(data: bytes) -> Iterator[SoundMessage]:
    """The messages among records that are known to be sound."""
    offset, end = 0, len(data)
    head, unpack, message_op = HEAD.unpack_from, MESSAGE.unpack_from, int(Opcode.MESSAGE)
    begin = HEAD.size + MESSAGE.size
    while offset < end:
        opcode, length = head(data, offset)
        stop = offset + 9 + length
        if opcode == message_op:
            channel, sequence, log_time_ns, publish_time_ns = unpack(data, offset + 9)
            yield SoundMessage(channel, sequence, log_time_ns, publish_time_ns, data[offset + begin : stop])
        offset = stop
