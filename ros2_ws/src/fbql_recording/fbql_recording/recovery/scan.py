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
from collections.abc import Callable, Iterator
from contextlib import suppress
from hashlib import sha256
from pathlib import Path
from typing import BinaryIO, NamedTuple

from fbql_common.core.errors import BadInput
from fbql_common.core.recording_names import RUN_RECORD
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
    summary_between,
    unpack,
)
from fbql_recording.mcap.reader import Topic, topic_of
from fbql_recording.recovery.accounting import (
    Ending,
    check_steps,
    chunks_in,
    compare_with_summary,
    count_by_numbers,
    drop_copies,
    lists_most,
    order_by_numbers,
)
from fbql_recording.recovery.parts import Found, Gap, Span
from fbql_recording.recovery.step_order import StepReader

_WINDOW = 2**20
"""Bytes that are searched at a time."""
_AHEAD = 2**16
"""Bytes of a record that are checked for the structure of a record."""
_HEADS = re.compile(rb"(?=[\x06\x07\x09\x0c]...[\x00-\x04]\x00{4})", re.DOTALL)
"""Heads of a chunk, a message index, an attachment or a Metadata record of at most MAX_RECORD_BYTES."""
_IN_SUMMARY = (
    *(Opcode.SCHEMA, Opcode.CHANNEL, Opcode.STATISTICS, Opcode.SUMMARY_OFFSET),
    *(Opcode.CHUNK_INDEX, Opcode.ATTACHMENT_INDEX, Opcode.METADATA_INDEX),
)
_HARMLESS = (Opcode.HEADER, Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE_INDEX)
"""Records whose loss does not interrupt the sequence of messages."""


class SoundMessage(NamedTuple):
    """A message as it was recorded."""

    channel: int
    sequence: int
    log_time_ns: int
    publish_time_ns: int
    data: bytes


class Scan:
    """The sound records of one MCAP file.

    Args:
        path: the file.
        progress: called now and then with the number of bytes scanned.
        continues: the file that it continues, if any.

    Raises:
        BadInput: it is not a recording of ROS 2, or nothing in it is sound.
    """

    def __init__(self, path: Path, progress: Callable[[int], None], *, continues: Scan | None = None) -> None:
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
        self.is_exact = False
        """Whether the number of lost messages is known; else it is a lower bound."""
        self._found: Found = []
        self._profile: str | None = None
        self._checked: list[Schema | Channel] = []
        """Copies that a CRC covers."""
        self._copies: list[Schema | Channel] = []
        """Copies that none covers."""
        self._is_numbered = continues is not None and continues._is_numbered
        """Whether the messages are numbered from 1, channel by channel, as our recorder does."""
        self._about: dict[str, str] | None = None
        """The recording's description of its run."""
        self._steps = StepReader()
        self._schemas: dict[int, Schema] = {}
        """As read so far, to find the steps."""
        self._indexes_due: dict[int, int] = {}
        """Message indexes of the last sound chunk that are still to come: channel -> messages."""
        self._indexes: dict[int, dict[int, tuple[int, int, int]]] = {}
        """First byte of a gap -> by channel id: messages, smallest and largest log time by its message indexes."""
        self._before = continues
        self.ending = Ending()
        """For the file that continues this one."""
        self._is_intact = False
        """Whether the CRC over everything matches."""
        self._is_displaced = False
        """Whether the parts need not begin where the summary says."""
        self._data_end: tuple[int, int] | None = None
        """First byte of the DataEnd record, and the CRC of everything before it."""
        try:
            self.size = path.stat().st_size
            with path.open("rb") as file:
                self._file = file
                self._summary = self._sound_summary()
                for record in () if self._summary is None else (*self._summary.schemas, *self._summary.channels):
                    self._describe_steps(record)
                self._scan()
                self._conclude()
        except OSError as error:
            raise unreadable(path, error) from None

    @property
    def gaps(self) -> list[Gap]:
        """The gaps, in the order of the file."""
        return [gap for gap in self._found if isinstance(gap, Gap)]

    def contents(self) -> Iterator[SoundMessage | Attachment | Metadata | Gap]:
        """Everything sound, in the order of the file, with the gaps in their places. Raises BadInput."""
        yield from self._read_again(lambda _: True)

    def records(self) -> Iterator[Attachment | Metadata]:
        """The sound attachments and Metadata records. Raises BadInput."""
        for content in self._read_again(lambda span: span.opcode in (Opcode.ATTACHMENT, Opcode.METADATA)):
            if isinstance(content, Attachment | Metadata):
                yield content

    @property
    def messages_lost(self) -> dict[str, int]:
        """The number of lost messages by topic: a lower bound, unless it `is_exact`."""
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
        if statistics is not None:
            # The summary's CRC covers it: nothing else knows better.
            return {name: recorded[name] - kept[name] for name in sorted(recorded) if recorded[name] > kept[name]}
        return {name: count for name, count in sorted(known.items()) if count > 0}

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
        listed = () if summary is None else {*summary.chunks, *summary.attachments, *summary.metadata}
        self._indexed = sorted(at for at in listed if at < self._limit)
        at = self._first_record()
        while at < self._limit and not self.has_end:
            self._progress(at)
            if self._other_begins(at):
                self._leave_out_other(at)
                break
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

    def _other_begins(self, at: int) -> bool:
        """Whether another recording begins at a byte that follows a record."""
        return at > len(MCAP0_MAGIC) and self._read(at, len(MCAP0_MAGIC) + 1) == MCAP0_MAGIC + bytes([Opcode.HEADER])

    def _is_of_another(self, about: Metadata) -> bool:
        """Whether a description of a run, which comes before the messages, is that of another recording."""
        self._about = about.metadata if self._about is None else self._about
        return self._about != about.metadata

    def _leave_out_other(self, at: int) -> None:
        """Ends the scan at a byte where another recording begins."""
        why = f"another recording begins at byte {at} of the file; it is left out"
        self._found.append(Gap(at, self.size, why, is_between_messages=False, is_odd=True))
        self._limit = self.size = at

    def _end_after(self, at: int) -> int | None:
        """The byte after the end of a recording whose summary begins at a byte; None if it does not."""
        while at < self.size:
            head = self._read(at, HEAD.size)
            if len(head) < HEAD.size:
                return None
            opcode, length = HEAD.unpack(head)
            at += HEAD.size + length
            if opcode == Opcode.FOOTER:
                is_end = length == FOOTER_BYTES - HEAD.size - len(MCAP0_MAGIC)
                is_end = is_end and self._read(at, len(MCAP0_MAGIC)) == MCAP0_MAGIC
                return at + len(MCAP0_MAGIC) if is_end else None
            if opcode not in _IN_SUMMARY:
                return None
        return None

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
        # Where a chunk with a CRC of its own ends is certain once that matches, wherever it came from.
        if end > (self._limit if opcode == Opcode.CHUNK else self._bound(at)):
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
            self._read_data_end(body, at, end)
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
            self._found.append(Span(Opcode.ATTACHMENT, at, end, name=record.name))
        elif isinstance(record, Metadata):
            if record.name == RUN_RECORD and self._summary is None and self._is_of_another(record):
                self._leave_out_other(at)
                return
            self._found.append(Span(Opcode.METADATA, at, end, name=record.name))
            if record.name == RUN_RECORD:
                self._is_numbered = True
        elif isinstance(record, Schema | Channel):
            self._copies.append(record)
            self._describe_steps(record)
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
                self._describe_steps(copies[-1])

        counts: Counter[int] = Counter()
        first: dict[int, int] = {}
        last: dict[int, int] = {}
        start_ns, end_ns = 2**64, 0
        data = unpack(chunk)
        with_steps = self._steps.channels
        for channel, sequence, log_time_ns, _, begin, stop in messages_in(data, describe):
            counts[channel] += 1
            last[channel] = sequence
            if channel not in first:
                first[channel] = sequence
                with_steps = self._steps.channels
            start_ns, end_ns = min(start_ns, log_time_ns), max(end_ns, log_time_ns)
            if channel in with_steps:
                self._steps.add(channel, data[begin:stop])
        steps = self._steps.take()
        if end > self._bound(at) and not chunk.crc:
            raise Damaged("it is longer than its space")
        (self._checked if chunk.crc else self._copies).extend(copies)
        self._indexes_due = dict(counts)
        identity = (chunk.codec, len(chunk.packed), chunk.size, sha256(data).digest())
        self._found.append(
            Span(
                Opcode.CHUNK,
                at,
                end,
                chunk.crc != 0,
                counts,
                first,
                last,
                start_ns if counts else 0,
                end_ns,
                identity,
                steps,
            )
        )

    def _describe_steps(self, record: Schema | Channel) -> None:
        """Finds the channels that hold steps."""
        if isinstance(record, Schema):
            self._schemas.setdefault(record.id, record)
        elif record.schema_id in self._schemas:
            with suppress(UnicodeDecodeError):
                self._steps.describe(record.id, topic_of(record, self._schemas[record.schema_id]))

    def _read_data_end(self, body: bytes, at: int, end: int) -> None:
        """Reads the end of the data, and the summary after it if it was not found from the end of the file. Raises
        Damaged."""
        if len(body) != 4:
            raise Damaged("it is not the end of the data")
        if self._summary is None and (size := self._end_after(end)) is not None:
            if self._other_begins(size):
                self._leave_out_other(size)
            elif size < self.size:
                self.notes.append(f"{self.size - size} bytes follow the end of the recording")
                self.size = size
            try:
                summary = summary_between(self._file, end, size)
                self._summary_damage = ""
                if summary.has_crc:
                    self._summary, self._is_displaced = summary, True
            except Damaged as damaged:
                self._summary_damage = str(damaged)
        elif self._search(end) < self._limit:
            raise Damaged("it is not the end of the data")
        self._data_end = at, int.from_bytes(body, "little")
        self.has_end = True

    def _read_message(self, body: bytes, at: int, end: int) -> None:
        """Reads a message outside of chunks, which has no CRC of its own."""
        if len(body) < MESSAGE_BYTES:
            raise Damaged("it is not a message")
        (channel,) = struct.unpack_from("<H", body)
        before = self._found[-1] if self._found else None
        if isinstance(before, Span) and (before.opcode, before.end) == (Opcode.MESSAGE, at):
            before.counts[channel] += 1
            before.end = end
        else:
            self._found.append(Span(Opcode.MESSAGE, at, end, False, Counter({channel: 1})))

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
        return self._search(start, bound)

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

    def _search(self, at: int, limit: int | None = None) -> int:
        """The first byte from `at` on that has the structure of a record; the limit where there is none."""
        limit = self._limit if limit is None else limit
        while at < limit:
            self._progress(at)
            window = self._read(at, _WINDOW)
            is_last = at + len(window) >= limit
            # What begins in a window's last bytes is looked at again at the beginning of the next.
            for match in _HEADS.finditer(window, 0, len(window) if is_last else _WINDOW - _AHEAD + HEAD.size):
                if at + match.start() >= limit:
                    return limit
                if self._has_structure(window, match.start(), at + match.start()):
                    return at + match.start()
            if is_last:
                break
            at += _WINDOW - _AHEAD
        return limit

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

    def _read_message_index(self, body: bytes) -> None:
        """Counts the messages of the chunk before a message index, if that chunk is lost."""
        (channel,) = struct.unpack_from("<H", body)
        times = struct.unpack_from(f"<{(len(body) - 6) // 8}Q", body, 6)[::2]
        if self._indexes_due.pop(channel, None) == len(times) or not times:
            return
        before = next((part for part in reversed(self._found) if not (isinstance(part, Gap) and part.attachment)), None)
        if isinstance(before, Gap):
            self._indexes.setdefault(before.begin, {}).setdefault(channel, (len(times), min(times), max(times)))

    def _believe_indexes(self) -> None:
        """Describes each gap by its chunk's head and message indexes, none of which a CRC covers: only if they agree."""
        for gap in self.gaps:
            indexes = self._indexes.get(gap.begin, {})
            start_ns = min((start for _, start, _ in indexes.values()), default=None)
            end_ns = max((end for _, _, end in indexes.values()), default=None)
            if start_ns is not None and (gap.start_ns, gap.end_ns) == (start_ns, end_ns):
                gap.messages = Counter({channel: count for channel, (count, _, _) in indexes.items()})
            else:
                gap.start_ns, gap.end_ns = None, None

    # What only the whole file shows

    @property
    def _listing(self) -> McapSummary | None:
        """The summary, where it tells how many messages there were: some writers leave that out."""
        return self._summary if self._summary is not None and self._summary.lists_messages else None

    def _conclude(self) -> None:
        self._drop_unchecked()
        self._describe()
        if self._is_displaced and self._summary is not None and not lists_most(self._found, self._summary):
            self._summary = None
        summary = self._listing
        if summary is not None:
            compare_with_summary(self._found, summary, is_displaced=self._is_displaced)
            self._forgive(summary)
        else:
            self._believe_indexes()
            drop_copies(self._found)
            if self._is_numbered:
                order_by_numbers(self._found)
                self._count()
            self._weigh_gaps()
        steps = check_steps(self._found, None if self._before is None else self._before.ending.steps)
        self.ending.steps = steps
        self.counts = sum((part.counts for part in self._found if isinstance(part, Span)), Counter[int]())
        is_odd = any(gap.is_odd for gap in self.gaps)
        self.is_exact = summary is not None or (self._is_intact and not is_odd)
        if summary is not None:
            self.is_exact = not any(gap.is_odd and gap.begin == gap.end and "sequence" in gap.why for gap in self.gaps)
        self._check_whole()
        if self._profile not in PROFILES:
            if self._profile is not None and {topic.message_encoding for topic in self.topics.values()} != {"cdr"}:
                raise BadInput(f"{self.path}: its profile is '{self._profile}'; recordings of ROS 2 have 'ros2'")
            self.notes.append("its header is damaged; its messages are those of ROS 2")
        self._drop_undescribed()
        if not self.counts.total() and not (self.has_end and not self.gaps):
            raise BadInput(f"{self.path}: no message in it is sound; there is nothing to recover")

    def _count(self) -> None:
        """Counts what is missing by the numbers of the messages, on from the file before this one."""
        before: dict[int, int] | None = {}
        if self._before is not None:
            # Each file may count from 1 again.
            reached = self._before.ending.numbers
            first = {c: n for _, chunk in reversed(list(chunks_in(self._found))) for c, n in chunk.first.items()}
            on = {c: reached[t.name] for c, t in self.topics.items() if t.name in reached}
            follows = bool(on) and all(first.get(channel, number + 1) > number for channel, number in on.items())
            before = on if follows and any(number != 1 for number in first.values()) else None
        numbers = count_by_numbers(self._found, before)
        self.ending.numbers = {self.topics[c].name: number for c, number in numbers.items() if c in self.topics}

    def _check_whole(self) -> None:
        """Compares all that was read with the one CRC over everything."""
        if self._data_end is None or self._data_end[1] == 0 or self._is_intact or self.gaps:
            return
        why = "the CRC over everything in it does not match"
        if self._listing is None:
            self._found.append(Gap(0, self.size, f"{why}; what differs is not known", is_between_messages=False))
        elif not self.notes:
            self.notes.append(f"{why}, but those of its parts do")

    def _drop_unchecked(self) -> None:
        """Drops data that only the CRC of the data section covers, if that does not match."""
        if self._data_end is not None and self._data_end[1] and not self.gaps:
            self._is_intact = data_crc(self._file, self._data_end[0]) == self._data_end[1]
        unchecked = [span for span in self._found if isinstance(span, Span) and not span.has_crc]
        if not unchecked:
            return
        if self._data_end is None or self._data_end[1] == 0:
            self.unchecked = sum(1 if span.opcode == Opcode.CHUNK else span.counts.total() for span in unchecked)
        elif not self._is_intact:
            for place, span in enumerate(self._found):
                if isinstance(span, Span) and not span.has_crc:
                    why = f"bytes {span.begin} to {span.end - 1}: the CRC of the file's data does not match, and they have no other"
                    chunks = int(span.opcode == Opcode.CHUNK)
                    self._found[place] = Gap(span.begin, span.end, why, span.opcode, chunks, messages=span.counts)

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

    def _forgive(self, summary: McapSummary) -> None:
        """Makes notes of the gaps in which nothing is lost, by a summary that lists everything."""
        harmless = [
            gap for gap in self.gaps if not (gap.chunks or gap.attachment or gap.is_odd or gap.is_between_messages)
        ]
        kept = sum(part.counts.total() for part in self._found if isinstance(part, Span))
        lost = sum(gap.messages.total() for gap in self.gaps)
        if summary.statistics is None or summary.statistics.message_count == kept + lost:
            self.notes += [gap.why for gap in harmless]
            self._found = [part for part in self._found if part not in harmless]

    def _weigh_gaps(self) -> None:
        """Describes each gap as far as possible without a summary."""
        has_messages = False
        for part in self._found:
            if isinstance(part, Span):
                has_messages |= bool(part.counts)
                continue
            gap = part
            if gap.is_odd:
                continue
            gap.messages = +gap.messages
            gap.chunks = max(gap.chunks, int(bool(gap.messages)))
            is_in_front = not has_messages and (gap.is_record or self._is_numbered)
            is_harmless = gap.is_record and gap.opcode in _HARMLESS
            gap.is_between_messages = bool(gap.chunks) or not (gap.attachment or is_in_front or is_harmless)

    def _drop_undescribed(self) -> None:
        """Drops messages of channels without a reliable description."""
        for channel in [channel for channel in self.counts if channel not in self.topics]:
            count = self.counts.pop(channel)
            self.is_exact = False
            if count:
                why = f"{count} messages: no undamaged record describes channel {channel}"
                self._found.insert(0, Gap(0, self.size, why, messages=Counter({channel: count})))

    # What is there

    def _read_again(self, is_wanted: Callable[[Span], bool]) -> Iterator[SoundMessage | Attachment | Metadata | Gap]:
        try:
            with self.path.open("rb") as file:
                for found in self._found:
                    if isinstance(found, Gap):
                        yield found
                    elif is_wanted(found):
                        yield from self._read_span(file, found)
        except OSError as error:
            raise unreadable(self.path, error) from None

    def _read_span(self, file: BinaryIO, span: Span) -> Iterator[SoundMessage | Attachment | Metadata]:
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
