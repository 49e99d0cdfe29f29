"""One MCAP file, read from front to back, with every check that the format allows. Memory: one chunk at a time.

Format: the MCAP specification, version 0. A file that was cut off is read up to its last whole record; damage is an
error that names the place, or, where the caller wants the rest, is skipped and counted.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import BinaryIO, NamedTuple

from fbql_common.core.errors import BadInput
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Footer, Metadata, Schema, Statistics
from mcap.writer import MCAP0_MAGIC

from fbql_recording.mcap.format import (
    CODECS,
    FIRST_PRIVATE,
    HEAD,
    MAX_RECORD_BYTES,
    MESSAGE,
    PROFILES,
    TELLING,
    chunk_head,
    has_layout,
    unpacked,
)

_FOOTER_BYTES = HEAD.size + 20 + len(MCAP0_MAGIC)
_NO_RECORD = (McapError, struct.error, UnicodeDecodeError, ValueError, OverflowError, EOFError)
"""What the mcap package raises for bytes that are no such record."""


class Corrupt(BadInput):
    """A file that is damaged at a place that the text names."""


class Message(NamedTuple):
    """A recorded message, its data as it was on the wire."""

    topic: str
    type_name: str
    """pkg/msg/Name"""
    log_time_ns: int
    publish_time_ns: int
    sequence: int
    data: bytes
    """CDR with its encapsulation header."""


@dataclass(frozen=True)
class Topic:
    """What a file says about one topic."""

    name: str
    type_name: str
    schema: str
    """The message definition (ros2msg text)."""
    metadata: dict[str, str]
    """`offered_qos_profiles`, `topic_type_hash`, where they are recorded."""
    message_encoding: str
    schema_encoding: str


@dataclass
class Damage:
    """What is wrong with a file, as far as it was read."""

    cut_off_at: int | None = None
    """Byte after the last whole record of a file without an end; None for a whole one."""
    chunks: dict[int, str] = field(default_factory=dict[int, str])
    """Chunks that were left out: the byte where each begins -> its number, time and what is wrong with it."""
    other: dict[int, str] = field(default_factory=dict[int, str])
    """Anything else that was left out, by the byte where it is."""

    @property
    def any(self) -> bool:
        """Whether anything is wrong."""
        return self.cut_off_at is not None or bool(self.chunks) or bool(self.other)


@dataclass(frozen=True)
class Window:
    """What is wanted of the messages: everything, unless said otherwise."""

    topics: Collection[str] | None = None
    start_ns: int | None = None
    """Log times from here on [ns]."""
    end_ns: int | None = None
    """Log times before this [ns]."""


EVERYTHING = Window()
Mark = Callable[[str, dict[str, str]], None]
"""Told of a Metadata record: its name and values."""


class McapFile:
    """One MCAP file.

    Args:
        path: the file.
        skip_corrupt: whether damage is left out and counted instead of raised.

    Raises:
        BadInput: no such file, not MCAP, or of a profile other than ros2.
        Corrupt: damaged.
    """

    def __init__(self, path: Path, skip_corrupt: bool = False) -> None:
        self.path = path
        self.damage = Damage()
        self.topics: dict[int, Topic] = {}
        """By channel id."""
        self.attachments: dict[str, bytes] = {}
        self.metadata: dict[int, tuple[str, dict[str, str]]] = {}
        """Metadata records, name and values, by the byte where they are."""
        self.counts: dict[str, int] = {}
        """Number of messages by topic; of a file without an end those before it was cut off."""
        self.start_ns: int | None = None
        """Smallest log time [ns]; None without messages."""
        self.end_ns: int | None = None
        """Largest log time [ns]; None without messages."""
        self.is_whole = False
        """Whether the file has its end."""
        self._skip_corrupt = skip_corrupt
        self._schemas: dict[int, Schema] = {}
        self._check_file()
        with self._open() as file:
            self._check_ends(file)
            if not (self.is_whole and self._read_summary(file)):
                self._read_all(file)

    def messages(self, window: Window = EVERYTHING, mark: Mark | None = None) -> Iterator[Message]:
        """The messages in the file's order.

        Args:
            window: which of them.
            mark: called with each Metadata record at its place between the messages.

        Raises:
            Corrupt: damage, unless it is skipped.
            BadInput: a record or chunk larger than MAX_RECORD_BYTES, or an unknown compression.
        """
        with self._open() as file:
            yield from self._scan(file, window, mark)

    # The file's two ends

    @contextmanager
    def _open(self) -> Iterator[BinaryIO]:
        try:
            with self.path.open("rb") as file:
                yield file
        except OSError as error:
            raise BadInput(f"{self.path}: can't be read ({error.strerror})") from None

    def _check_file(self) -> None:
        if not self.path.exists():
            raise BadInput(f"{self.path}: no such file")
        if not self.path.is_file():
            raise BadInput(f"{self.path}: not a file")
        self.size = self.path.stat().st_size

    def _check_ends(self, file: BinaryIO) -> None:
        if self.size == 0:
            raise BadInput(f"{self.path}: the file is empty (0 bytes); nothing was recorded")
        magic = file.read(len(MCAP0_MAGIC))
        if magic != MCAP0_MAGIC[: len(magic)]:
            raise BadInput(f"{self.path}: not an MCAP file (it does not begin like one)")
        if len(magic) < len(MCAP0_MAGIC):
            raise BadInput(f"{self.path}: cut off after {len(magic)} bytes; nothing was recorded")
        if self.size >= len(MCAP0_MAGIC) + _FOOTER_BYTES:
            file.seek(self.size - len(MCAP0_MAGIC))
            self.is_whole = file.read() == MCAP0_MAGIC

    def _read_summary(self, file: BinaryIO) -> bool:
        """Takes topics, statistics, attachments and metadata from a whole file's summary. False: it has none."""
        footer_at = self.size - _FOOTER_BYTES
        file.seek(footer_at)
        tail = file.read(_FOOTER_BYTES)
        opcode, length = HEAD.unpack_from(tail)
        if opcode != Opcode.FOOTER or length != 20:
            return self._complain(footer_at, "its footer is damaged")
        footer = Footer.read(ReadDataStream(BytesIO(tail[HEAD.size :])))
        if footer.summary_start == 0:
            return False
        if not len(MCAP0_MAGIC) <= footer.summary_start <= footer_at:
            return self._complain(footer_at, "its footer is damaged")
        if footer_at - footer.summary_start > MAX_RECORD_BYTES:
            raise BadInput(f"{self.path}: a summary of more than {MAX_RECORD_BYTES >> 20} MiB is not read")
        file.seek(footer.summary_start)
        summary = file.read(footer_at - footer.summary_start)
        if footer.summary_crc and zlib.crc32(summary + tail[:-12]) != footer.summary_crc:
            return self._complain(footer.summary_start, "the CRC of its summary does not match")
        statistics: Statistics | None = None
        places: list[tuple[int, int]] = []
        at = 0
        try:
            while at < len(summary):
                opcode, length = HEAD.unpack_from(summary, at)
                body = summary[at + HEAD.size : at + HEAD.size + length]
                if opcode in (Opcode.ATTACHMENT_INDEX, Opcode.METADATA_INDEX):
                    places.append(struct.unpack_from("<QQ", body))
                elif opcode == Opcode.STATISTICS:
                    statistics = Statistics.read(ReadDataStream(BytesIO(body)))
                else:
                    self._take(opcode, body, footer.summary_start + at, has_crc=footer.summary_crc != 0)
                at += HEAD.size + length
        except _NO_RECORD:
            return self._complain(footer.summary_start + at, "its summary is damaged")
        if statistics is None or (statistics.message_count and not self.topics):
            return False
        if statistics.message_count:
            self.start_ns, self.end_ns = statistics.message_start_time, statistics.message_end_time
        for channel, topic in self.topics.items():
            self._count(topic.name, statistics.channel_message_counts.get(channel, 0))
        for offset, length in sorted(places):
            self._take_at(file, offset, length)
        return True

    def _take_at(self, file: BinaryIO, offset: int, length: int) -> None:
        """Takes an attachment or Metadata record that the summary points at."""
        if length > MAX_RECORD_BYTES:
            raise self._too_large(offset, length)
        file.seek(offset)
        data = file.read(length)
        if len(data) < max(length, HEAD.size) or HEAD.unpack_from(data)[1] != length - HEAD.size:
            self._complain(offset, "a record that the summary points at is not there")
        else:
            self._take(data[0], data[HEAD.size :], offset)

    def _read_all(self, file: BinaryIO) -> None:
        """What the summary would have said, from the messages themselves."""
        for topic in self.topics.values():
            self._count(topic.name, 0)
        for message in self._scan(file, EVERYTHING, None):
            self._count(message.topic, 1)
            time_ns = message.log_time_ns
            self.start_ns = time_ns if self.start_ns is None else min(self.start_ns, time_ns)
            self.end_ns = time_ns if self.end_ns is None else max(self.end_ns, time_ns)
        for topic in self.topics.values():
            self._count(topic.name, 0)

    def _count(self, topic: str, messages: int) -> None:
        self.counts[topic] = self.counts.get(topic, 0) + messages

    # Record by record

    def _scan(self, file: BinaryIO, window: Window, mark: Mark | None) -> Iterator[Message]:
        """Everything from the front on."""
        file.seek(0)
        crc = zlib.crc32(file.read(len(MCAP0_MAGIC)))
        at = len(MCAP0_MAGIC)
        number = 0
        while True:
            head = file.read(HEAD.size)
            opcode, length = HEAD.unpack(head) if len(head) == HEAD.size else (0, 0)
            rest = self.size - at - HEAD.size
            if length > rest or len(head) < HEAD.size:
                self._end_at(at, length)
                return
            if length > MAX_RECORD_BYTES:
                raise self._too_large(at, length)
            body = file.read(length)
            if opcode == Opcode.DATA_END:
                if not self.is_whole:
                    self.damage.cut_off_at = at
                self._check_data_end(body, crc, at)
                return
            if opcode == Opcode.FOOTER or opcode == 0:
                self._complain(at, "there is no record where one should be")
                return
            crc = zlib.crc32(body, zlib.crc32(head, crc))
            if opcode == Opcode.CHUNK:
                number += 1
                yield from self._chunk(body, at, number, window)
            elif not self._is_of_its_kind(opcode, body):
                self._complain(at, f"a record of kind {opcode} is damaged")
            elif opcode == Opcode.MESSAGE:
                yield from self._messages(HEAD.pack(opcode, length) + body, at, window)
            else:
                self._take(opcode, body, at)
                if mark is not None and at in self.metadata:
                    mark(*self.metadata[at])
            at += HEAD.size + length

    @staticmethod
    def _is_of_its_kind(opcode: int, body: bytes) -> bool:
        """Whether a record's structure is that of its kind; not known to the specification: whether it is no other's."""
        if opcode == Opcode.MESSAGE or opcode >= FIRST_PRIVATE:
            return not any(has_layout(kind, body, 0, len(body)) for kind in TELLING)
        return has_layout(opcode, body, 0, len(body))

    def _check_data_end(self, body: bytes, crc: int, at: int) -> None:
        recorded = int.from_bytes(body, "little")
        if len(body) != 4:
            self._complain(at, "the end of its data section is damaged")
        elif recorded and recorded != crc and not self.damage.any:
            # The chunks have CRCs of their own, which matched.
            self._complain(at, "the CRC of its data section does not match: something beside the chunks is damaged")

    def _end_at(self, at: int, length: int) -> None:
        """The file ends in the middle of a record: it was cut off, or, if it has its end, that record is damaged."""
        if self.is_whole:
            self._complain(at, f"a record claims {length} bytes, which is more than there are")
        else:
            self.damage.cut_off_at = at

    def _take(self, opcode: int, body: bytes, at: int, has_crc: bool = False) -> None:
        """Takes over what is no message. What a CRC covers is believed where it is described twice."""
        stream = ReadDataStream(BytesIO(body))
        try:
            if opcode == Opcode.HEADER:
                self._check_profile(body)
            elif opcode == Opcode.SCHEMA:
                schema = Schema.read(stream)
                if self._schemas.setdefault(schema.id, schema) != schema:
                    self._complain(at, f"schema {schema.id} is described twice, and differently")
                    self._schemas[schema.id] = schema if has_crc else self._schemas[schema.id]
            elif opcode == Opcode.CHANNEL:
                self._take_channel(Channel.read(stream), at, has_crc)
            elif opcode == Opcode.ATTACHMENT:
                self._take_attachment(body, at)
            elif opcode == Opcode.METADATA:
                record = Metadata.read(stream)
                self.metadata[at] = (record.name, record.metadata)
        except _NO_RECORD as error:
            if isinstance(error, BadInput):
                raise
            self._complain(at, f"a record of kind {opcode} is damaged")

    def _check_profile(self, body: bytes) -> None:
        (length,) = struct.unpack_from("<I", body)
        profile = body[4 : 4 + length].decode()
        if profile not in PROFILES:
            raise BadInput(f"{self.path}: its profile is '{profile}'; recordings of ROS 2 have 'ros2'")

    def _take_channel(self, channel: Channel, at: int, has_crc: bool) -> None:
        schema = self._schemas.get(channel.schema_id)
        if schema is None and channel.schema_id != 0:
            self._complain(at, f"topic {channel.topic} has no schema")
            return
        topic = Topic(
            channel.topic,
            "" if schema is None else schema.name,
            "" if schema is None else schema.data.decode(),
            channel.metadata,
            channel.message_encoding,
            "" if schema is None else schema.encoding,
        )
        if self.topics.setdefault(channel.id, topic) != topic:
            self._complain(at, f"channel {channel.id} is described twice, and differently")
            self.topics[channel.id] = topic if has_crc else self.topics[channel.id]

    def _take_attachment(self, body: bytes, at: int) -> None:
        record = Attachment.read(ReadDataStream(BytesIO(body)))
        (recorded,) = struct.unpack_from("<I", body, len(body) - 4)
        if recorded and recorded != zlib.crc32(body[:-4]):
            self._complain(at, f"the CRC of attachment {record.name} does not match")
        else:
            self.attachments.setdefault(record.name, record.data)

    def _chunk(self, body: bytes, at: int, number: int, window: Window) -> Iterator[Message]:
        where = f"chunk {number} (at byte {at})"
        try:
            start_ns, end_ns, size, crc, name, begin, packed_size = chunk_head(body)
        except (struct.error, UnicodeDecodeError):
            self._lose_chunk(at, f"{where} is damaged: its head is no such")
            return
        where = f"chunk {number} ({start_ns / 1e9:.3f} s to {end_ns / 1e9:.3f} s, at byte {at})"
        if packed_size != len(body) - begin:
            self._lose_chunk(at, f"{where} is damaged: its sizes do not fit")
            return
        if name not in CODECS:
            raise BadInput(f"{self.path}: {where} is compressed by '{name}'; known are zstd, lz4 and none")
        if size > MAX_RECORD_BYTES:
            raise BadInput(
                f"{self.path}: {where} unpacks to {size} bytes; at most {MAX_RECORD_BYTES >> 20} MiB are read"
            )
        if window.start_ns is not None and end_ns < window.start_ns:
            return
        if window.end_ns is not None and start_ns >= window.end_ns:
            return
        packed = body[begin:]
        try:
            data = unpacked(name, packed, size)
        except ValueError:
            self._lose_chunk(at, f"{where} is damaged: it can't be unpacked")
            return
        if len(data) != size:
            self._lose_chunk(at, f"{where} is damaged: it unpacks to {len(data)} bytes instead of {size}")
        elif crc and zlib.crc32(data) != crc:
            self._lose_chunk(at, f"{where} is damaged: its CRC does not match")
        else:
            yield from self._messages(data, at, window, has_crc=crc != 0)

    def _messages(self, data: bytes, at: int, window: Window, has_crc: bool = False) -> Iterator[Message]:
        """The messages among the records of a chunk."""
        topics, start_ns, end_ns = window.topics, window.start_ns, window.end_ns
        offset, end = 0, len(data)
        head, unpack, message_op = HEAD.unpack_from, MESSAGE.unpack_from, int(Opcode.MESSAGE)
        begin = HEAD.size + MESSAGE.size
        known: dict[int, tuple[str, str, bool]] = {}
        while offset < end:
            try:
                opcode, length = head(data, offset)
                stop = offset + 9 + length
                if stop > end:
                    raise struct.error
                if opcode != message_op:
                    self._take(opcode, data[offset + 9 : stop], at, has_crc)
                    offset = stop
                    continue
                channel_id, sequence, log_ns, publish_ns = unpack(data, offset + 9)
            except struct.error:
                self._complain(at, "the records of a chunk are damaged")
                return
            if channel_id not in known:
                described = self.topics.get(channel_id)
                if described is None:
                    self._complain(at, f"a message of channel {channel_id}, which is not described")
                    offset = stop
                    continue
                wanted = topics is None or described.name in topics
                known[channel_id] = described.name, described.type_name, wanted
            topic, type_name, wanted = known[channel_id]
            if wanted and (start_ns is None or log_ns >= start_ns) and (end_ns is None or log_ns < end_ns):
                yield Message(topic, type_name, log_ns, publish_ns, sequence, data[offset + begin : stop])
            offset = stop

    # What is wrong

    def _complain(self, at: int, what: str) -> bool:
        """Raises, or notes that something was left out. Always False."""
        if not self._skip_corrupt:
            raise Corrupt(f"{self.path}: damaged at byte {at}: {what}; skip_corrupt (--skip-corrupt) reads the rest")
        self.damage.other[at] = what
        return False

    def _lose_chunk(self, at: int, what: str) -> None:
        if not self._skip_corrupt:
            raise Corrupt(f"{self.path}: {what}; skip_corrupt (--skip-corrupt) reads the rest")
        self.damage.chunks[at] = what

    def _too_large(self, at: int, length: int) -> BadInput:
        return BadInput(
            f"{self.path}: a record of {length} bytes at byte {at}; at most {MAX_RECORD_BYTES >> 20} MiB are read"
        )
