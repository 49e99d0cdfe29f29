"""One MCAP file, read from front to back, with every check that the format allows. Memory: one chunk at a time.

Format: the MCAP specification, version 0. A file that was cut off is read up to its last complete record; damage is an
error that names the place, or is skipped and counted if the caller asks for that.
"""

from __future__ import annotations

import os
import zlib
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO, NamedTuple

from fbql_common.core.errors import BadInput
from fbql_common.files import unreadable
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Header, Metadata, Schema
from mcap.writer import MCAP0_MAGIC

from fbql_recording.mcap.format import (
    CODECS,
    FIRST_PRIVATE,
    FOOTER_BYTES,
    HEAD,
    MAX_RECORD_BYTES,
    PROFILES,
    Damaged,
    fits,
    is_misnamed,
    messages_in,
    parse,
    parse_chunk,
    read_summary,
    unpack,
)


class Corrupt(BadInput):
    """A damaged file; the text names the place."""


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
    """One topic as the file describes it."""

    name: str
    type_name: str
    schema: str
    """The message definition: ros2msg text; in another encoding bytes that are not UTF-8 are escaped (surrogateescape)."""
    metadata: dict[str, str]
    """`offered_qos_profiles`, `topic_type_hash`, if they are recorded."""
    message_encoding: str
    schema_encoding: str

    @property
    def kind(self) -> tuple[str, str, str]:
        """What its messages are."""
        return self.type_name, self.message_encoding, self.schema_encoding


def topic_of(channel: Channel, schema: Schema | None) -> Topic:
    """The topic of a channel and its schema. Raises UnicodeDecodeError: the schema should be text and is not."""
    errors = "strict" if schema is not None and schema.encoding == "ros2msg" else "surrogateescape"
    return Topic(
        channel.topic,
        "" if schema is None else schema.name,
        "" if schema is None else schema.data.decode(errors=errors),
        channel.metadata,
        channel.message_encoding,
        "" if schema is None else schema.encoding,
    )


def _kind_words(kind: tuple[str, str, str]) -> str:
    type_name, message_encoding, schema_encoding = kind
    return f"'{type_name}' ({message_encoding or 'no encoding'} by {schema_encoding or 'no schema'})"


@dataclass
class Damage:
    """The damage of a file, as far as it was read."""

    cut_off_at: int | None = None
    """Byte after the last complete record of a file that was cut off; None for a complete one."""
    chunks: dict[int, str] = field(default_factory=dict[int, str])
    """Chunks that were left out: the byte where each begins -> its number, time and what is wrong with it."""
    other: dict[int, str] = field(default_factory=dict[int, str])
    """Anything else that was left out, by its position in bytes."""

    @property
    def any(self) -> bool:
        """Whether anything is wrong."""
        return self.cut_off_at is not None or bool(self.chunks) or bool(self.other)


@dataclass(frozen=True)
class Window:
    """Which messages are wanted: all by default."""

    topics: Collection[str] | None = None
    start_ns: int | None = None
    """Log times from here on [ns]."""
    end_ns: int | None = None
    """Log times before this [ns]."""


_CDR = "cdr"
EVERYTHING = Window()
Mark = Callable[[str, dict[str, str]], None]
"""Called with the name and values of each Metadata record."""


class McapFile:
    """One MCAP file.

    Args:
        path: the file.
        skip_corrupt: whether damage is left out and counted instead of raised.
        known: topics of the same recording, by name, that an earlier file has.

    Raises:
        BadInput: no such file, not MCAP, or of a profile other than ros2.
        Corrupt: damaged.
    """

    def __init__(self, path: Path, skip_corrupt: bool = False, known: Mapping[str, Topic] | None = None) -> None:
        self.path = path
        self.damage = Damage()
        self.topics: dict[int, Topic] = {}
        """By channel id."""
        self.left_out: dict[int, str] = {}
        """Channels that are not read, with the reason: messages of another kind under the name of another topic."""
        self.attachments: dict[str, bytes] = {}
        self.metadata: dict[int, tuple[str, dict[str, str]]] = {}
        """Metadata records, name and values, by their position in bytes."""
        self.counts: dict[str, int] = {}
        """Number of messages by topic; for a file that was cut off, those before the cut."""
        self.start_ns: int | None = None
        """Smallest log time [ns]; None without messages."""
        self.end_ns: int | None = None
        """Largest log time [ns]; None without messages."""
        self.is_whole = False
        """Whether the file is complete."""
        self._skip_corrupt = skip_corrupt
        self._schemas: dict[int, Schema] = {}
        self._kinds = {name: topic.kind for name, topic in (known or {}).items()}
        if path.exists() and not path.is_file():
            raise BadInput(f"{path}: not a file")
        with self._open() as file:
            self.size = os.fstat(file.fileno()).st_size
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
            raise unreadable(self.path, error) from None

    def _check_ends(self, file: BinaryIO) -> None:
        if self.size == 0:
            raise BadInput(f"{self.path}: the file is empty (0 bytes); nothing was recorded")
        magic = file.read(len(MCAP0_MAGIC))
        if magic != MCAP0_MAGIC[: len(magic)]:
            raise BadInput(f"{self.path}: not an MCAP file (it does not begin like one)")
        if len(magic) < len(MCAP0_MAGIC):
            raise BadInput(f"{self.path}: cut off after {len(magic)} bytes; nothing was recorded")
        if self.size > 2 * len(MCAP0_MAGIC):
            file.seek(self.size - len(MCAP0_MAGIC))
            self.is_whole = file.read() == MCAP0_MAGIC

    def _read_summary(self, file: BinaryIO) -> bool:
        """Reads topics, statistics, attachments and metadata from a complete file's summary. False: it does not have
        them."""
        try:
            summary = read_summary(file, self.size)
        except Damaged as damaged:
            return self._complain(self.size - FOOTER_BYTES, str(damaged))
        if summary is None:
            return False
        for record in (*summary.schemas, *summary.channels):
            self._add(record, summary.start, summary.has_crc)
        statistics = summary.statistics
        if statistics is None or (statistics.message_count and not self.topics):
            return False
        if statistics.message_count:
            self.start_ns, self.end_ns = statistics.message_start_time, statistics.message_end_time
        for channel, topic in self.topics.items():
            self._count(topic.name, statistics.channel_message_counts.get(channel, 0))
        for offset, index in sorted({**summary.attachments, **summary.metadata}.items()):
            self._read_indexed(file, offset, index.length)
        return True

    def _read_indexed(self, file: BinaryIO, offset: int, length: int) -> None:
        """Reads an attachment or Metadata record that the summary points at."""
        if length > MAX_RECORD_BYTES:
            raise self._too_large(offset, length)
        file.seek(min(offset, self.size))
        data = file.read(length)
        if len(data) < max(length, HEAD.size) or HEAD.unpack_from(data)[1] != length - HEAD.size:
            self._complain(offset, "a record that the summary points at is not there")
        else:
            self._read_record(data[0], data[HEAD.size :], offset)

    def _read_all(self, file: BinaryIO) -> None:
        """Reads from the messages themselves what the summary would have contained."""
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
        """Everything from the beginning."""
        file.seek(0)
        crc = zlib.crc32(file.read(len(MCAP0_MAGIC)))
        at = len(MCAP0_MAGIC)
        chunks = 0
        while True:
            head = file.read(HEAD.size)
            opcode, length = HEAD.unpack(head) if len(head) == HEAD.size else (0, 0)
            if len(head) < HEAD.size or length > self.size - at - HEAD.size:
                if self.is_whole:
                    self._complain(at, f"a record claims {length} bytes, which is more than there are")
                else:
                    self.damage.cut_off_at = at
                return
            if length > MAX_RECORD_BYTES:
                raise self._too_large(at, length)
            body = file.read(length)
            if opcode == Opcode.DATA_END:
                if not self.is_whole:
                    self.damage.cut_off_at = at
                self._check_data_end(body, crc, at)
                return
            if opcode in (0, Opcode.FOOTER):
                self._complain(at, "there is no record where one should be")
                return
            crc = zlib.crc32(body, zlib.crc32(head, crc))
            if opcode == Opcode.CHUNK:
                chunks += 1
                yield from self._read_chunk(body, at, chunks, window)
            elif opcode == Opcode.MESSAGE or opcode >= FIRST_PRIVATE:
                if is_misnamed(body, follows_chunk=chunks > 0):
                    self._complain(at, f"a record of kind {opcode} is damaged")
                elif opcode == Opcode.MESSAGE:
                    yield from self._messages(head + body, at, window)
            else:
                self._read_record(opcode, body, at)
                if mark is not None and at in self.metadata:
                    mark(*self.metadata[at])
            at += HEAD.size + length

    def _check_data_end(self, body: bytes, crc: int, at: int) -> None:
        recorded = int.from_bytes(body, "little")
        if len(body) != 4:
            self._complain(at, "the end of its data section is damaged")
        elif recorded and recorded != crc and not self.damage.any:
            # The chunks have their own CRCs, which matched.
            self._complain(at, "the CRC of its data section does not match: something beside the chunks is damaged")

    def _read_record(self, opcode: int, body: bytes, at: int) -> None:
        """Reads a record of the data section that is neither chunk nor message."""
        try:
            if opcode == Opcode.MESSAGE_INDEX:
                if not fits(opcode, len(body), body):
                    raise Damaged
                return
            record = parse(opcode, body)
            if isinstance(record, Header):
                if record.profile not in PROFILES:
                    raise BadInput(f"{self.path}: its profile is '{record.profile}'; recordings of ROS 2 have 'ros2'")
            elif isinstance(record, Attachment):
                self.attachments.setdefault(record.name, record.data)
            elif isinstance(record, Metadata):
                self.metadata[at] = (record.name, record.metadata)
            elif isinstance(record, Schema | Channel):
                self._add(record, at)
            else:
                raise Damaged
        except Damaged as damaged:
            self._complain(at, str(damaged) or f"a record of kind {opcode} is damaged")

    def _add(self, record: Schema | Channel, at: int, has_crc: bool = False) -> None:
        """Adds a schema or a topic. If it is described twice, the copy that a CRC covers is used."""
        if isinstance(record, Schema):
            if self._schemas.setdefault(record.id, record) != record:
                self._complain(at, f"schema {record.id} is described twice, and differently")
                self._schemas[record.id] = record if has_crc else self._schemas[record.id]
            return
        schema = self._schemas.get(record.schema_id)
        if schema is None and record.schema_id != 0:
            self._complain(at, f"topic {record.topic} has no schema")
            return
        try:
            topic = topic_of(record, schema)
        except UnicodeDecodeError:
            self._complain(at, f"the schema of topic {record.topic} is not a text")
            return
        if record.id in self.left_out or self._is_of_another_kind(record.id, topic):
            return
        if self.topics.setdefault(record.id, topic) != topic:
            self._complain(at, f"channel {record.id} is described twice, and differently")
            self.topics[record.id] = topic if has_crc else self.topics[record.id]

    def _is_of_another_kind(self, channel: int, topic: Topic) -> bool:
        """Whether a topic of this name has messages of another kind, which are the ones to be read: the first, or CDR."""
        kind = self._kinds.setdefault(topic.name, topic.kind)
        if channel in self.topics or kind == topic.kind:
            return False
        others = [channel]
        if _CDR in topic.kind[1:] and _CDR not in kind[1:]:
            others = [number for number, other in self.topics.items() if other.name == topic.name]
            self._kinds[topic.name], kind = topic.kind, topic.kind
        for number in others:
            other = self.topics.pop(number, topic)
            self.left_out[number] = (
                f"topic {topic.name} is recorded as {_kind_words(kind)} and as {_kind_words(other.kind)}; "
                "the latter is not read"
            )
        return channel in self.left_out

    def _read_chunk(self, body: bytes, at: int, number: int, window: Window) -> Iterator[Message]:
        where = f"chunk {number} (at byte {at})"
        try:
            chunk = parse_chunk(body)
            where = f"chunk {number} ({chunk.start_ns / 1e9:.3f} s to {chunk.end_ns / 1e9:.3f} s, at byte {at})"
            if chunk.codec not in CODECS:
                raise BadInput(f"{self.path}: {where} is compressed by '{chunk.codec}'; known are zstd, lz4 and none")
            if chunk.size > MAX_RECORD_BYTES:
                limit = f"at most {MAX_RECORD_BYTES >> 20} MiB are read"
                raise BadInput(f"{self.path}: {where} unpacks to {chunk.size} bytes; {limit}")
            if window.start_ns is not None and chunk.end_ns < window.start_ns:
                return
            if window.end_ns is not None and chunk.start_ns >= window.end_ns:
                return
            data = unpack(chunk)
        except Damaged as damaged:
            what = f"{where} is damaged: {damaged}"
            if not self._skip_corrupt:
                raise Corrupt(f"{self.path}: {what}; skip_corrupt (--skip-corrupt) reads the rest") from None
            self.damage.chunks[at] = what
        else:
            yield from self._messages(data, at, window, has_crc=chunk.crc != 0)

    def _messages(self, data: bytes, at: int, window: Window, has_crc: bool = False) -> Iterator[Message]:
        """The messages among the records of a chunk."""
        topics, start_ns, end_ns = window.topics, window.start_ns, window.end_ns
        known: dict[int, tuple[str, str, bool]] = {}

        def describe(opcode: int, body: bytes) -> None:
            if opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                self._add(parse(opcode, body), at, has_crc)

        try:
            for channel_id, sequence, log_ns, publish_ns, begin, end in messages_in(data, describe):
                if channel_id not in known:
                    if channel_id in self.left_out:
                        known[channel_id] = "", "", False
                        continue
                    described = self.topics.get(channel_id)
                    if described is None:
                        self._complain(at, f"a message of channel {channel_id}, which is not described")
                        continue
                    wanted = topics is None or described.name in topics
                    known[channel_id] = described.name, described.type_name, wanted
                topic, type_name, wanted = known[channel_id]
                if wanted and (start_ns is None or log_ns >= start_ns) and (end_ns is None or log_ns < end_ns):
                    yield Message(topic, type_name, log_ns, publish_ns, sequence, data[begin:end])
        except Damaged:
            self._complain(at, "the records of a chunk are damaged")

    # What is wrong

    def _complain(self, at: int, what: str) -> bool:
        """Raises, or notes that something was left out. Always False."""
        if not self._skip_corrupt:
            raise Corrupt(f"{self.path}: damaged at byte {at}: {what}; skip_corrupt (--skip-corrupt) reads the rest")
        self.damage.other[at] = what
        return False

    def _too_large(self, at: int, length: int) -> BadInput:
        return BadInput(
            f"{self.path}: a record of {length} bytes at byte {at}; at most {MAX_RECORD_BYTES >> 20} MiB are read"
        )
