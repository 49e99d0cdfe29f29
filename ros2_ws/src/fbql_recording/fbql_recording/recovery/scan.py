"""Finds the sound records of a damaged MCAP file, and the gaps between them.

A file is scanned from record to record. A record is sound where its fields are as long as it is and its CRC, if it has
one, matches; nothing else is kept, and nothing is repaired. After a damaged record the scan resumes at its end
according to its length, if a record begins there; else where the summary says that a chunk, an attachment or a Metadata
record begins; else at the next bytes that have the structure of a record. Schemas and channels are taken from the
summary if its CRC matches, else from the first chunk, else from before it.

The number of messages in a gap follows from the summary's chunk index; without a summary, from the message indexes
that follow a lost chunk and from the numbers of the messages around it, which our own recorder counts from 1 for each
channel.

Memory: one chunk, and a few words for each chunk of the file. Source: the MCAP specification, version 0.
"""

from __future__ import annotations

import re
import struct
from bisect import bisect_right
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO, NamedTuple

from fbql_common.core.errors import BadInput
from fbql_common.core.recording_names import BAG_RECORD, GAP_RECORD, RUN_RECORD
from fbql_common.files import unreadable
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, ChunkIndex, Header, Metadata, Schema
from mcap.writer import MCAP0_MAGIC

from fbql_recording.mcap.format import (
    CODECS,
    FIRST_PRIVATE,
    FOOTER_BYTES,
    HEAD,
    MAX_RECORD_BYTES,
    MESSAGE_BYTES,
    PROFILES,
    Damaged,
    McapSummary,
    data_crc,
    fits,
    is_misnamed,
    length_by_fields,
    messages_in,
    parse,
    parse_chunk,
    read_summary,
    unpack,
)
from fbql_recording.mcap.reader import Topic, topic_of

_WINDOW = 2**20
"""Bytes that are searched at a time."""
_AHEAD = 2**16
"""Bytes of a record that are checked for the structure of a record."""
_HEADS = re.compile(rb"(?=[\x06\x07\x09\x0c]...[\x00-\x04]\x00{4})", re.DOTALL)
"""Heads of a chunk, a message index, an attachment or a Metadata record of at most MAX_RECORD_BYTES."""
_HARMLESS = (Opcode.HEADER, Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE_INDEX)
"""Records whose loss does not interrupt the sequence of messages."""


class SoundMessage(NamedTuple):
    """A message as it was recorded."""

    channel: int
    sequence: int
    log_time_ns: int
    publish_time_ns: int
    data: bytes


@dataclass
class Gap:
    """A part of a file that is lost."""

    begin: int
    end: int
    """Bytes begin to end - 1."""
    why: str
    opcode: int = 0
    """Of the damaged record, if it can be read."""
    chunks: int = 0
    start_ns: int | None = None
    end_ns: int | None = None
    """Smallest and largest log time in it [ns]; None: not known."""
    messages: Counter[int] = field(default_factory=Counter[int])
    """Messages in it by channel id: a lower bound."""
    attachment: str = ""
    """The name of the attachment, if it was one."""
    is_record: bool = False
    """Whether it is one record, of which only the length is reliable."""
    is_between_messages: bool = True
    """Whether messages, or the notes between them, may be missing between those before and after it."""


class _Span(NamedTuple):
    """A sound record, or several messages outside of chunks."""

    opcode: int
    begin: int
    end: int
    has_crc: bool = True
    counts: Counter[int] = Counter()  # noqa: RUF012 - never changed
    """Messages by channel id."""


class Scan:
    """The sound records of one MCAP file.

    Args:
        path: the file.
        progress: called now and then with the number of bytes scanned.
        continues: whether the file continues another, so that its messages need not be counted from 1.

    Raises:
        BadInput: it is not a recording of ROS 2, or nothing in it is sound.
    """

    def __init__(self, path: Path, progress: Callable[[int], None], *, continues: bool = False) -> None:
        self.path = path
        self.notes: list[str] = []
        """Damage without loss, one line each."""
        self.topics: dict[int, Topic] = {}
        """By channel id."""
        self.counts: Counter[int] = Counter()
        """Sound messages by channel id."""
        self.unchecked = 0
        """Number of chunks, and of messages outside of chunks, that no CRC covers."""
        self.has_end = False
        """Whether the file was finished."""
        self._progress = progress
        self._continues = continues
        self._found: list[_Span | Gap] = []
        self._profile: str | None = None
        self._checked: list[Schema | Channel] = []
        """Copies that a CRC covers."""
        self._copies: list[Schema | Channel] = []
        """Copies that none covers."""
        self._numbers: dict[int, tuple[int, int]] | None = None
        """Channel -> number of its last message, and how many records had been found then; None: messages are not
        numbered."""
        self._indexes_due: dict[int, int] = {}
        """Message indexes of the last sound chunk that are still to come: channel -> messages."""
        self._index_times: dict[int, tuple[int, int]] = {}
        """First byte of a gap -> smallest and largest log time by its message indexes."""
        self._data_end: tuple[int, int] | None = None
        """First byte of the DataEnd record, and the CRC of everything before it."""
        try:
            self.size = path.stat().st_size
            with path.open("rb") as file:
                self._file = file
                self._summary = self._sound_summary()
                self._scan()
                self._conclude()
        except OSError as error:
            raise unreadable(path, error) from None

    @property
    def gaps(self) -> list[Gap]:
        """What is lost, in the order of the file."""
        return [gap for gap in self._found if isinstance(gap, Gap)]

    def contents(self) -> Iterator[SoundMessage | Attachment | Metadata | Gap]:
        """Everything sound, in the order of the file, with the gaps in their places. Raises BadInput."""
        yield from self._read_again(lambda _: True)

    def records(self) -> Iterator[Attachment | Metadata]:
        """The sound attachments and Metadata records. Raises BadInput."""
        for content in self._read_again(lambda span: span.opcode in (Opcode.ATTACHMENT, Opcode.METADATA)):
            if isinstance(content, Attachment | Metadata):
                yield content

    def messages_lost(self, expected: Mapping[str, int]) -> dict[str, int]:
        """The number of lost messages by topic: a lower bound.

        Args:
            expected: the original number by topic, if metadata.yaml has it.
        """
        known: Counter[str] = Counter()
        kept: Counter[str] = Counter()
        recorded: Counter[str] = Counter()
        for gap in self.gaps:
            for channel, count in gap.messages.items():
                known[self.topics[channel].name if channel in self.topics else f"channel {channel}"] += count
        statistics = None if self._summary is None else self._summary.statistics
        for channel, topic in self.topics.items():
            kept[topic.name] += self.counts[channel]
            recorded[topic.name] += 0 if statistics is None else statistics.channel_message_counts.get(channel, 0)
        total = Counter(expected) | recorded
        lost = {name: max(known[name], total[name] - kept[name]) for name in sorted({*known, *total})}
        return {name: count for name, count in lost.items() if count > 0}

    # From record to record

    def _sound_summary(self) -> McapSummary | None:
        try:
            summary = read_summary(self._file, self.size)
        except Damaged as damaged:
            self._summary_damage = str(damaged)
            return None
        self._summary_damage = ""
        return summary if summary is not None and summary.has_crc else None

    def _scan(self) -> None:
        summary = self._summary
        self._limit = self.size if summary is None else summary.start
        self._indexed = [] if summary is None else sorted({*summary.chunks, *summary.attachments, *summary.metadata})
        at = self._first_record()
        while at < self._limit and not self.has_end:
            self._progress(at)
            try:
                end = self._read_record(at)
            except Damaged as damaged:
                end = self._resume(at)
                self._add_gap(at, end, damaged)
            at = end
        is_ended = self.size >= 2 * len(MCAP0_MAGIC) and self._read(self.size - 8, 8) == MCAP0_MAGIC
        self.has_end |= summary is not None or is_ended
        if self.has_end and not is_ended:
            self.notes.append("its last bytes are damaged")
        elif self.has_end and self._summary_damage:
            self.notes.append(self._summary_damage)

    def _read(self, at: int, size: int) -> bytes:
        self._file.seek(at)
        return self._file.read(size)

    def _first_record(self) -> int:
        """The byte of the first record. Raises BadInput."""
        if self.size == 0:
            raise BadInput(f"{self.path}: the file is empty (0 bytes); nothing was recorded")
        magic = self._read(0, len(MCAP0_MAGIC))
        if magic == MCAP0_MAGIC[: len(magic)] and self.size <= len(MCAP0_MAGIC):
            raise BadInput(f"{self.path}: cut off after {self.size} bytes; nothing was recorded")
        if magic != MCAP0_MAGIC:
            if self._summary is None and not self._is_record(len(MCAP0_MAGIC)):
                raise BadInput(f"{self.path}: not an MCAP file (it does not begin like one)")
            self.notes.append("its first bytes are damaged")
        return len(MCAP0_MAGIC)

    def _bound(self, at: int) -> int:
        """The byte at which a record must have ended: where the next one begins according to the summary."""
        place = bisect_right(self._indexed, at)
        return self._indexed[place] if place < len(self._indexed) else self._limit

    def _read_record(self, at: int) -> int:
        """Reads the record at a byte; returns the byte after it. Raises Damaged."""
        head = self._read(at, HEAD.size)
        if len(head) < HEAD.size:
            raise Damaged("it is cut off")
        opcode, length = HEAD.unpack(head)
        end = at + HEAD.size + length
        if end > self._bound(at):
            raise Damaged("it is longer than its space")
        if length > MAX_RECORD_BYTES:
            raise Damaged(f"it is larger than {MAX_RECORD_BYTES >> 20} MiB")
        body = self._file.read(length)
        if opcode == Opcode.CHUNK:
            self._indexes_due = {}
            self._read_chunk(body, at, end)
        elif opcode == Opcode.MESSAGE_INDEX:
            if not fits(opcode, length, body):
                raise Damaged("it is not a message index")
            self._read_message_index(body)
        elif opcode == Opcode.MESSAGE or opcode >= FIRST_PRIVATE:
            if is_misnamed(body, follows_chunk=any(span.opcode == Opcode.CHUNK for span in self._found)):
                raise Damaged("its opcode is damaged")
            if opcode == Opcode.MESSAGE:
                self._read_message(body, at, end)
        elif opcode == Opcode.DATA_END:
            if length != 4 or self._search(end) < self._limit:
                raise Damaged("it is not the end of the data")
            self._data_end = at, int.from_bytes(body, "little")
            self.has_end = True
        elif opcode == Opcode.FOOTER:
            # A chunk is one flipped bit away from it: what ends the scan must be where a footer is.
            if at != self.size - FOOTER_BYTES or end != self.size - len(MCAP0_MAGIC):
                raise Damaged("it is not the end of the file")
            self.has_end = True
        else:
            self._keep(parse(opcode, body), at, end)
        return end

    def _keep(self, record: object, at: int, end: int) -> None:
        if isinstance(record, Attachment):
            self._found.append(_Span(Opcode.ATTACHMENT, at, end))
        elif isinstance(record, Metadata):
            self._found.append(_Span(Opcode.METADATA, at, end))
            if record.name == RUN_RECORD and self._numbers is None:
                self._numbers = {}
            elif record.name == GAP_RECORD and self._numbers:
                # Recovered before: what the numbers lack here is known to be lost.
                self._numbers = {}
                self._continues = True
        elif isinstance(record, Schema | Channel):
            self._copies.append(record)
        elif isinstance(record, Header):
            self._profile = record.profile

    def _read_chunk(self, body: bytes, at: int, end: int) -> None:
        chunk = parse_chunk(body)
        if chunk.codec not in CODECS:
            raise Damaged(f"it is compressed by {chunk.codec!r}")
        if chunk.size > MAX_RECORD_BYTES:
            raise Damaged(f"it unpacks to more than {MAX_RECORD_BYTES >> 20} MiB")
        copies: list[Schema | Channel] = []

        def describe(opcode: int, body: bytes) -> None:
            if opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                copies.append(parse(opcode, body))

        counts: Counter[int] = Counter()
        first: dict[int, int] = {}
        last: dict[int, int] = {}
        for channel, sequence, _, _, _, _ in messages_in(unpack(chunk), describe):
            counts[channel] += 1
            last[channel] = sequence
            if channel not in first:
                first[channel] = sequence
        (self._checked if chunk.crc else self._copies).extend(copies)
        self._check_numbers(first, last, at)
        self._indexes_due = dict(counts)
        self.counts += counts
        self._found.append(_Span(Opcode.CHUNK, at, end, chunk.crc != 0, counts))

    def _read_message(self, body: bytes, at: int, end: int) -> None:
        """Reads a message outside of chunks, which has no CRC of its own."""
        if len(body) < MESSAGE_BYTES:
            raise Damaged("it is not a message")
        channel, sequence = struct.unpack_from("<HI", body)
        self._check_numbers({channel: sequence}, {channel: sequence}, at)
        self.counts[channel] += 1
        before = self._found[-1] if self._found else None
        if isinstance(before, _Span) and (before.opcode, before.end) == (Opcode.MESSAGE, at):
            before.counts[channel] += 1
            self._found[-1] = before._replace(end=end)
        else:
            self._found.append(_Span(Opcode.MESSAGE, at, end, False, Counter({channel: 1})))

    # Behind damage

    def _resume(self, at: int) -> int:
        """The byte where the scan resumes after the damaged record at a byte."""
        head = self._read(at, _AHEAD)
        bound = self._bound(at)
        start = at + 1
        if len(head) >= HEAD.size:
            opcode, length = HEAD.unpack_from(head)
            end = at + HEAD.size + length
            if end == bound or (end < bound and self._is_record(end)):
                return end
            # An attachment may hold a recording, whose chunks are not this file's: its own fields give its length again.
            inside = length_by_fields(opcode, head[HEAD.size :]) if opcode == Opcode.ATTACHMENT else None
            if inside is not None and at + HEAD.size + inside <= bound:
                start = at + HEAD.size + inside
        return bound if self._indexed else self._search(start)

    def _is_record(self, at: int) -> bool:
        """Whether the bytes at a place have the structure of a record."""
        return self._has_structure(self._read(at, _AHEAD), 0, at)

    def _has_structure(self, data: bytes, offset: int, at: int) -> bool:
        """Whether data[offset:], which is at a byte of the file, has the structure of a record; it may lack its end."""
        if len(data) < offset + HEAD.size:
            return False
        opcode, length = HEAD.unpack_from(data, offset)
        if length > MAX_RECORD_BYTES or at + HEAD.size + length > self._limit:
            return False
        if opcode == Opcode.MESSAGE:
            return length >= MESSAGE_BYTES
        begin = offset + HEAD.size
        return fits(opcode, length, data[begin : begin + min(length, _AHEAD)])

    def _search(self, at: int) -> int:
        """The first byte from `at` on that has the structure of a record; the limit where there is none."""
        while at < self._limit:
            self._progress(at)
            window = self._read(at, _WINDOW)
            is_last = at + len(window) >= self._limit
            # What begins in a window's last bytes is looked at again at the beginning of the next.
            for match in _HEADS.finditer(window, 0, len(window) if is_last else _WINDOW - _AHEAD + HEAD.size):
                if self._has_structure(window, match.start(), at + match.start()):
                    return at + match.start()
            if is_last:
                break
            at += _WINDOW - _AHEAD
        return self._limit

    def _add_gap(self, at: int, end: int, damaged: Damaged) -> None:
        head = self._read(at, _AHEAD)
        gap = Gap(at, end, f"bytes {at} to {end - 1} are damaged: {damaged}", head[0])
        if len(head) >= HEAD.size:
            body = head[HEAD.size :]
            length = HEAD.unpack_from(head)[1]
            gap.is_record = end == at + HEAD.size + length
            if gap.opcode == Opcode.CHUNK and fits(gap.opcode, length, body):
                gap.why = f"the chunk at byte {at} is damaged: {damaged}"
                gap.chunks = 1
                gap.start_ns, gap.end_ns = struct.unpack_from("<QQ", body)
            elif gap.opcode == Opcode.ATTACHMENT and end - at - HEAD.size in (
                length,
                length_by_fields(gap.opcode, body),
            ):
                gap.attachment = self._attachment_name(at)
        if end == self.size:
            gap.why = f"the file ends at byte {at}, in the middle of a record"
        self._found.append(gap)

    def _attachment_name(self, at: int) -> str:
        try:
            begin = at + HEAD.size + 20
            (length,) = struct.unpack("<I", self._read(begin - 4, 4))
            return self._read(begin, min(length, _AHEAD)).decode()
        except (struct.error, UnicodeDecodeError):
            return ""

    # How many messages are missing

    def _gaps_since(self, place: int) -> list[Gap]:
        return [gap for gap in self._found[place:] if isinstance(gap, Gap) and not gap.attachment]

    def _read_message_index(self, body: bytes) -> None:
        """Counts the messages of the chunk before a message index, if that chunk is lost."""
        (channel,) = struct.unpack_from("<H", body)
        times = struct.unpack_from(f"<{(len(body) - 6) // 8}Q", body, 6)[::2]
        if self._indexes_due.pop(channel, None) == len(times) or not times:
            return
        for gap in reversed(self._found):
            if not isinstance(gap, Gap):
                return
            if not gap.attachment:
                gap.messages[channel] += len(times)
                known = self._index_times.get(gap.begin, (times[0], times[0]))
                self._index_times[gap.begin] = min(known[0], *times), max(known[1], *times)
                return

    def _check_numbers(self, first: Mapping[int, int], last: Mapping[int, int], at: int) -> None:
        """Counts the messages of each channel that are missing before a byte, by their numbers."""
        if self._numbers is None:
            return
        for channel, number in first.items():
            before, place = self._numbers.get(channel, (number - 1 if self._continues else 0, 0))
            missing = number - before - 1
            gaps = self._gaps_since(place)
            if missing > 0 and not gaps:
                gaps = [Gap(at, at, f"messages before byte {at} are not there")]
                self._found += gaps
            unknown = missing - sum(gap.messages[channel] for gap in gaps)
            if unknown < 0:
                # A message index is damaged. The numbers are not: a CRC covers them.
                for gap in gaps:
                    del gap.messages[channel]
                unknown = missing
            if unknown > 0:
                next((gap for gap in gaps if not gap.messages[channel]), gaps[-1]).messages[channel] += unknown
        for channel, number in last.items():
            self._numbers[channel] = number, len(self._found) + 1

    # What only the whole file shows

    def _conclude(self) -> None:
        self._drop_unchecked()
        self._describe()
        summary = self._summary
        if summary is not None and self._indexed:
            self._compare_with(summary)
        else:
            self._weigh_gaps()
        if self._profile not in PROFILES:
            if self._profile is not None and {topic.message_encoding for topic in self.topics.values()} != {"cdr"}:
                raise BadInput(f"{self.path}: its profile is '{self._profile}'; recordings of ROS 2 have 'ros2'")
            self.notes.append("its header is damaged; its messages are those of ROS 2")
        self._drop_undescribed()
        if not self.counts.total() and not (self.has_end and not self.gaps):
            raise BadInput(f"{self.path}: no message in it is sound; there is nothing to recover")

    def _drop_unchecked(self) -> None:
        """Drops data that only the CRC of the data section covers, if that does not match."""
        unchecked = [span for span in self._found if isinstance(span, _Span) and not span.has_crc]
        if not unchecked:
            return
        if self._data_end is None or self._data_end[1] == 0:
            self.unchecked = sum(1 if span.opcode == Opcode.CHUNK else span.counts.total() for span in unchecked)
        elif data_crc(self._file, self._data_end[0]) != self._data_end[1]:
            for place, span in enumerate(self._found):
                if isinstance(span, _Span) and not span.has_crc:
                    why = f"bytes {span.begin} to {span.end - 1}: the CRC of the file's data does not match, and they have no other"
                    chunks = int(span.opcode == Opcode.CHUNK)
                    self._found[place] = Gap(span.begin, span.end, why, span.opcode, chunks, messages=span.counts)
                    self.counts -= span.counts

    def _describe(self) -> None:
        """Chooses among the copies of each schema and channel; if no CRC covers any of them, they must not contradict
        each other."""
        summary = self._summary
        known: dict[tuple[type, int], Schema | Channel] = {}
        contradicted: set[tuple[type, int]] = set()
        checked = [*summary.schemas, *summary.channels] if summary is not None and summary.channels else self._checked
        known.update({(type(record), record.id): record for record in checked})
        is_checked = set(known)
        for record in self._copies:
            key = type(record), record.id
            if key in is_checked and known[key] != record:
                kind = type(record).__name__.lower()
                self.notes.append(f"{kind} {record.id} is damaged before the first chunk; another copy of it is used")
            elif summary is not None and summary.channels and key not in is_checked:
                continue
            elif known.setdefault(key, record) != record:
                contradicted.add(key)
        for (kind, number), channel in known.items():
            if not isinstance(channel, Channel):
                continue
            key = Schema, channel.schema_id
            schema = known.get(key)
            is_described = channel.schema_id == 0 or isinstance(schema, Schema)  # 0: a topic without a schema
            if is_described and not contradicted & {key, (kind, number)}:
                try:
                    self.topics[number] = topic_of(channel, schema if isinstance(schema, Schema) else None)
                except UnicodeDecodeError:
                    self.notes.append(f"topic {channel.topic}: the definition of its messages is not a text")

    def _compare_with(self, summary: McapSummary) -> None:
        """Describes each gap by the summary: no gap extends beyond the next record that the summary points to."""
        harmless: list[Gap] = []
        has_messages = False
        for found in self._found:
            if isinstance(found, _Span):
                has_messages |= bool(found.counts)
                continue
            gap, chunk = found, summary.chunks.get(found.begin)
            attachment, metadata = summary.attachments.get(gap.begin), summary.metadata.get(gap.begin)
            gap.chunks, gap.start_ns, gap.end_ns = 0, None, None
            gap.attachment = attachment.name if attachment is not None else ""
            gap.is_between_messages = chunk is not None or (metadata is not None and has_messages)
            if chunk is not None:
                gap.chunks, gap.start_ns, gap.end_ns = 1, chunk.message_start_time, chunk.message_end_time
                gap.messages = _messages_in(chunk)
            elif not (attachment or gap.messages) and (metadata is None or metadata.name == BAG_RECORD):
                harmless.append(gap)
        lost = sum(gap.messages.total() for gap in self.gaps)
        if summary.statistics is None or summary.statistics.message_count == self.counts.total() + lost:
            self.notes += [gap.why for gap in harmless]
            self._found = [found for found in self._found if found not in harmless]

    def _weigh_gaps(self) -> None:
        """Describes each gap as far as possible without a summary."""
        has_messages = False
        for found in self._found:
            if isinstance(found, _Span):
                has_messages |= bool(found.counts)
                continue
            gap = found
            gap.messages = +gap.messages
            gap.chunks = max(gap.chunks, int(bool(gap.messages)))
            by_index = self._index_times.get(gap.begin) if gap.messages else None
            by_head = None if gap.start_ns is None or gap.end_ns is None else (gap.start_ns, gap.end_ns)
            # Neither has a CRC: times are reported if they make sense and nothing contradicts them.
            start_ns, end_ns = by_head or by_index or (1, 0)
            first_ns, last_ns = by_index or (start_ns, end_ns)
            is_likely = start_ns <= first_ns <= last_ns <= end_ns
            gap.start_ns, gap.end_ns = (start_ns, end_ns) if is_likely else (None, None)
            is_in_front = not has_messages and (gap.is_record or self._numbers is not None)
            is_harmless = gap.is_record and gap.opcode in _HARMLESS
            gap.is_between_messages = bool(gap.chunks) or not (gap.attachment or is_in_front or is_harmless)

    def _drop_undescribed(self) -> None:
        """Drops messages of channels without a reliable description."""
        for channel in [channel for channel in self.counts if channel not in self.topics]:
            count = self.counts.pop(channel)
            if count:
                why = f"{count} messages: no undamaged record describes channel {channel}"
                self._found.insert(0, Gap(0, self.size, why, messages=Counter({channel: count})))

    # What is there

    def _read_again(self, is_wanted: Callable[[_Span], bool]) -> Iterator[SoundMessage | Attachment | Metadata | Gap]:
        try:
            with self.path.open("rb") as file:
                for found in self._found:
                    if isinstance(found, Gap):
                        yield found
                    elif is_wanted(found):
                        yield from self._read_span(file, found)
        except OSError as error:
            raise unreadable(self.path, error) from None

    def _read_span(self, file: BinaryIO, span: _Span) -> Iterator[SoundMessage | Attachment | Metadata]:
        at = span.begin
        while at < span.end:
            file.seek(at)
            head = file.read(HEAD.size)
            opcode, length = HEAD.unpack(head)
            body = file.read(length)
            at += HEAD.size + length
            if opcode in (Opcode.ATTACHMENT, Opcode.METADATA):
                yield parse(opcode, body)
                continue
            data = unpack(parse_chunk(body)) if opcode == Opcode.CHUNK else head + body
            for channel, sequence, log_time_ns, publish_time_ns, begin, end in messages_in(data):
                if channel in self.topics:
                    yield SoundMessage(channel, sequence, log_time_ns, publish_time_ns, data[begin:end])


def _messages_in(chunk: ChunkIndex) -> Counter[int]:
    """Messages of a chunk by channel id: the sizes of its message indexes, which follow each other, give the
    numbers."""
    begins = sorted((begin, channel) for channel, begin in chunk.message_index_offsets.items())
    ends = [begin for begin, _ in begins[1:]]
    ends.append(chunk.chunk_start_offset + chunk.chunk_length + chunk.message_index_length)
    sizes = {channel: end - begin - HEAD.size - 6 for (begin, channel), end in zip(begins, ends, strict=False)}
    return Counter({channel: size // 16 for channel, size in sizes.items() if size > 0 and size % 16 == 0})
