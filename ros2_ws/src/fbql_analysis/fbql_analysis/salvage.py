"""What is sound in a damaged MCAP file, and what of it is lost.

A file is gone through twice. `Survey` finds what is sound: from record to record, each checked by the structure of its
kind and, where it has one, by its CRC; where there is no record it goes on at the next place that is one. Then
`Survey.contents` reads what was found. Memory: one chunk, and a few words for each chunk of the file.

What guards what. Chunks and attachments have CRCs: what fails is lost, whatever else says that it could be right. The
summary has one too; it holds all schemas and channels once more, and tells what the file held. What has none, in a file
without an end, is believed unless something contradicts it. Format: the MCAP specification, version 0.
"""

from __future__ import annotations

import re
import struct
import zlib
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import BinaryIO, NamedTuple

from fbql_common.core.errors import BadInput
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Metadata, Schema
from mcap.writer import MCAP0_MAGIC

from fbql_analysis.mcap_file import Topic
from fbql_analysis.mcap_format import (
    CODECS,
    FIRST_PRIVATE,
    HEAD,
    MAX_RECORD_BYTES,
    MESSAGE,
    PROFILES,
    TELLING,
    chunk_head,
    has_layout,
    inner_length,
    unpacked,
)
from fbql_analysis.salvage_channels import Descriptions
from fbql_analysis.salvage_summary import sound_summary

_WINDOW = 2**20
"""Bytes that are searched at a time."""
_AHEAD = 2**16
"""Bytes behind a place that are looked at to tell whether it is a record."""
# A kind from 1 to 15, and a length of at most MAX_RECORD_BYTES. A message has nothing else to be known by: 5 is left out.
_HEADS = re.compile(rb"(?=[\x01-\x04\x06-\x0f]...[\x00-\x04]\x00{4})", re.DOTALL)


class SoundMessage(NamedTuple):
    """A message that is as it was recorded."""

    channel: int
    sequence: int
    log_time_ns: int
    publish_time_ns: int
    data: bytes


@dataclass
class Loss:
    """A part of a file that is lost."""

    begin: int
    end: int
    """Bytes begin to end - 1."""
    why: str
    chunks: int = 0
    start_ns: int | None = None
    end_ns: int | None = None
    """Log times that were in it, at most; None: not known."""
    messages: dict[int, int] = field(default_factory=dict[int, int])
    """Messages that were in it by channel: at least so many."""
    attachment: str = ""
    """The name of the attachment that it was."""
    is_gap: bool = True
    """Whether messages may be missing between those before and after it."""


Content = SoundMessage | Attachment | Metadata | Loss


class _Place(NamedTuple):
    """Where something is that `contents` gives."""

    kind: int
    """An opcode; 0: a loss, whose index is `at`."""
    at: int
    end: int
    codec: str = ""
    """Of a chunk, what it is really packed with."""
    begin: int = 0
    """Of a chunk, where its packed records begin."""
    size: int = 0
    """Of a chunk, unpacked."""
    has_crc: bool = True
    """Whether a CRC of its own says that it is sound."""


class _Tally:
    """The messages of one channel in one chunk."""

    __slots__ = ("count", "first", "last")

    def __init__(self, sequence: int) -> None:
        self.count = 0
        self.first = self.last = sequence


class Survey:
    """What is sound in one MCAP file.

    Args:
        path: the file.
        progress: told how many bytes have been gone through, now and then.

    Raises:
        BadInput: nothing in it tells that it ever was a recording of ROS 2.
    """

    def __init__(self, path: Path, progress: Callable[[int], None]) -> None:
        self.path = path
        self.losses: list[Loss] = []
        """In the order of the file."""
        self.notes: list[str] = []
        """What is damaged and costs nothing, a line each."""
        self.topics: dict[int, Topic] = {}
        """By channel id."""
        self.counts: Counter[int] = Counter()
        """Sound messages by channel id."""
        self.unchecked = 0
        """Chunks, and messages outside of chunks, that have no CRC: whether they are sound can't be told."""
        self.has_end = False
        """Whether the file goes on to the end of its data."""
        self._progress = progress
        self._places: list[_Place] = []
        self._descriptions = Descriptions()
        self._profile: str | None = None
        self._last: dict[int, tuple[int, int]] = {}
        self._uncounted: set[int] = set()
        self._by_sequence: list[tuple[int, int, int]] = []
        self._by_index: Counter[tuple[int, int]] = Counter()
        self._indexes_to_come: dict[int, int] = {}
        self._data_end: tuple[int, int] | None = None
        try:
            self.size = path.stat().st_size
            with path.open("rb") as file:
                self._file = file
                self._go_through()
        except OSError as error:
            raise BadInput(f"{path}: can't be read ({error.strerror})") from None

    def contents(self) -> Iterator[Content]:
        """Everything that is sound, in the order of the file, with the losses in their places. Raises BadInput."""
        try:
            with self.path.open("rb") as file:
                for place in self._places:
                    yield from self._content(file, place)
        except OSError as error:
            raise BadInput(f"{self.path}: can't be read ({error.strerror})") from None

    def records(self) -> Iterator[Attachment | Metadata]:
        """The sound attachments and Metadata records, without the messages. Raises BadInput."""
        for place in self._places:
            if place.kind in (Opcode.ATTACHMENT, Opcode.METADATA):
                with self.path.open("rb") as file:
                    yield from self._content(file, place)  # pyright: ignore[reportReturnType]

    @property
    def chunks_lost(self) -> int:
        """Number of chunks that are lost."""
        return sum(loss.chunks for loss in self.losses)

    def lost(self, expected: Mapping[str, int]) -> dict[str, int]:
        """Messages that are lost, by topic: at least so many.

        Args:
            expected: how many there were, where somebody else knows.
        """
        known: Counter[str] = Counter()
        kept: Counter[str] = Counter()
        total: Counter[str] = Counter(expected)
        for loss in self.losses:
            for channel, count in loss.messages.items():
                known[self.topics[channel].name if channel in self.topics else f"channel {channel}"] += count
        for channel, topic in self.topics.items():
            kept[topic.name] += self.counts[channel]
        if self._summary is not None and self._summary.statistics is not None:
            recorded: Counter[str] = Counter()
            for channel, count in self._summary.statistics.channel_message_counts.items():
                if channel in self.topics:
                    recorded[self.topics[channel].name] += count
            total |= recorded
        names = {*known, *total}
        lost = {name: max(known[name], total[name] - kept[name]) for name in sorted(names)}
        return {name: count for name, count in lost.items() if count > 0}

    # From record to record

    def _go_through(self) -> None:
        self._summary = sound_summary(self._read, self.size)
        at = self._begin()
        while at < self.size and not self._is_end(at):
            self._progress(at)
            end = self._record(at)
            if end is None:
                end = self._next(at + 1)
                self._skip(at, end)
            at = end
        self._conclude()

    def _read(self, at: int, size: int) -> bytes:
        self._file.seek(at)
        return self._file.read(size)

    def _begin(self) -> int:
        """The byte of the first record. Raises BadInput."""
        if self.size == 0:
            raise BadInput(f"{self.path}: the file is empty (0 bytes); nothing was recorded")
        magic = self._read(0, len(MCAP0_MAGIC))
        if magic == MCAP0_MAGIC[: len(magic)] and self.size <= len(MCAP0_MAGIC):
            raise BadInput(f"{self.path}: cut off after {self.size} bytes; nothing was recorded")
        if magic != MCAP0_MAGIC:
            if self._summary is None and not self._is_record(self._read(len(MCAP0_MAGIC), _AHEAD), 0, len(MCAP0_MAGIC)):
                raise BadInput(f"{self.path}: not an MCAP file (it does not begin like one)")
            self.notes.append("its first bytes are damaged")
        return len(MCAP0_MAGIC)

    def _is_end(self, at: int) -> bool:
        return at == self.size - len(MCAP0_MAGIC) and self._read(at, len(MCAP0_MAGIC)) == MCAP0_MAGIC

    def _record(self, at: int) -> int | None:
        """Takes over the record at a byte; gives the byte after it, or None where there is no record."""
        head = self._read(at, HEAD.size)
        if len(head) < HEAD.size:
            return None
        opcode, length = HEAD.unpack(head)
        begin = at + HEAD.size
        end = begin + length
        if opcode == Opcode.CHUNK and self._is_elsewhere(at):
            return None
        if length <= MAX_RECORD_BYTES and end <= self.size:
            body = self._read(begin, length)
            # Where the structure is that of another kind, it is the kind that is damaged.
            for kind in (opcode, *TELLING):
                if has_layout(kind, body, 0, length) and not (kind == Opcode.CHUNK and self._is_elsewhere(at)):
                    if kind != opcode:
                        self.notes.append(f"the kind of the record at byte {at} is damaged; its structure tells it")
                    self._take(kind, body, at, end)
                    return end
            if opcode == Opcode.MESSAGE and length >= MESSAGE.size:
                self._take_message(body, at, end)
                return end
            if opcode >= FIRST_PRIVATE and self._is_record(self._read(end, _AHEAD), 0, end):
                return end
        if opcode in (Opcode.CHUNK, Opcode.ATTACHMENT):
            if end > self.size and has_layout(opcode, self._read(begin, _AHEAD), 0, length):
                # It tells its length twice: the file was cut off in the middle of it.
                self._skip(at, self.size)
                return self.size
            return self._by_content(opcode, at)
        return None

    def _by_content(self, opcode: int, at: int) -> int | None:
        """A chunk or attachment whose length is damaged: it tells its length a second time; its CRC, whether that is so."""
        begin = at + HEAD.size
        size = inner_length(opcode, self._read(begin, _AHEAD))
        if size is None or size > MAX_RECORD_BYTES or begin + size > self.size:
            return None
        body = self._read(begin, size)
        is_chunk = opcode == Opcode.CHUNK
        if chunk_head(body).crc == 0 or self._unpack(body) is None if is_chunk else not _has_crc(body):
            return None
        self.notes.append(f"the length of the record at byte {at} is damaged; its content is sound")
        self._take(opcode, body, at, begin + size)
        return begin + size

    def _next(self, at: int) -> int:
        """The next byte at which there is a record; the file's size where there is none."""
        while at < self.size:
            self._progress(at)
            window = self._read(at, _WINDOW)
            is_last = at + len(window) >= self.size
            # What begins at the window's end is looked at again at the beginning of the next.
            for match in _HEADS.finditer(window, 0, len(window) if is_last else _WINDOW - _AHEAD + HEAD.size):
                if self._is_record(window, match.start(), at + match.start()):
                    return at + match.start()
            if is_last:
                break
            at += _WINDOW - _AHEAD
        return self.size

    def _is_record(self, data: bytes, offset: int, at: int) -> bool:
        """Whether data[offset:] looks like a record; `at` is its byte in the file."""
        if len(data) < offset + HEAD.size:
            return False
        opcode, length = HEAD.unpack_from(data, offset)
        begin = offset + HEAD.size
        if length > MAX_RECORD_BYTES or at + HEAD.size + length > self.size:
            return False
        return has_layout(opcode, data, begin, begin + length) and not (
            opcode == Opcode.CHUNK and self._is_elsewhere(at)
        )

    def _is_elsewhere(self, at: int) -> bool:
        """Whether a chunk can't be here, because the summary tells where all of them are."""
        return self._summary is not None and bool(self._summary.chunks) and at not in self._summary.chunks

    # What a record is

    def _take(self, opcode: int, body: bytes, at: int, end: int) -> None:
        stream = ReadDataStream(BytesIO(body))
        if opcode == Opcode.CHUNK:
            self._take_chunk(body, at, end)
        elif opcode == Opcode.MESSAGE_INDEX:
            self._take_index(body)
        elif opcode == Opcode.ATTACHMENT:
            self._take_attachment(body, at, end)
        elif opcode == Opcode.METADATA:
            self._places.append(_Place(opcode, at, end))
        elif opcode == Opcode.SCHEMA:
            self._descriptions.add(Schema.read(stream), False)
        elif opcode == Opcode.CHANNEL:
            self._descriptions.add(Channel.read(stream), False)
        elif opcode == Opcode.HEADER and self._profile is None:
            (length,) = struct.unpack_from("<I", body)
            self._profile = body[4 : 4 + length].decode()
        elif opcode == Opcode.DATA_END:
            self._data_end = at, int.from_bytes(body, "little")

    def _take_chunk(self, body: bytes, at: int, end: int) -> None:
        self._indexes_to_come = {}
        head = chunk_head(body)
        found = self._unpack(body)
        if found is None:
            why = "its CRC does not match" if head.codec in CODECS else f"it is compressed by '{head.codec}'"
            self._lose(Loss(at, end, f"the chunk at byte {at} is damaged: {why}", 1, head.start_ns, head.end_ns))
            return
        codec, data = found
        try:
            tallies, descriptions = _walk(data)
        except (struct.error, ValueError):
            why = f"the chunk at byte {at} is damaged: its records are no such"
            self._lose(Loss(at, end, why, 1, head.start_ns, head.end_ns))
            return
        for record in descriptions:
            self._descriptions.add(record, head.crc != 0)
        self.unchecked += head.crc == 0
        for channel, tally in tallies.items():
            self._count(channel, tally)
            self._indexes_to_come[channel] = tally.count
        place = _Place(Opcode.CHUNK, at, end, codec, at + HEAD.size + head.begin, len(data), head.crc != 0)
        self._places.append(place)

    def _unpack(self, body: bytes) -> tuple[str, bytes] | None:
        """What a chunk is really packed with, and its records; None where no reading of it is sound.

        Its size and the name of its compression may be what is damaged: its CRC tells.
        """
        head = chunk_head(body)
        packed = body[head.begin :]
        codecs = [head.codec] if head.crc == 0 else sorted(CODECS, key=lambda codec: codec != head.codec)
        sizes = [size for size in {head.size: 0, MAX_RECORD_BYTES: 0} if size <= MAX_RECORD_BYTES]
        for codec in codecs:
            for size in sizes:
                if codec not in CODECS or (size != head.size and head.crc == 0):
                    continue
                try:
                    data = unpacked(codec, packed, size)
                except ValueError:
                    continue
                if len(data) <= size and (zlib.crc32(data) == head.crc if head.crc else len(data) == head.size):
                    return codec, data
        return None

    def _count(self, channel: int, tally: _Tally) -> None:
        """Counts a chunk's messages of a channel; their sequence tells how many are missing, where it counts them."""
        self.counts[channel] += tally.count
        last, losses = self._last.get(channel, (0, 0))
        missing = tally.first - last - 1
        if missing < 0 or (missing and losses == len(self.losses)) or tally.last - tally.first + 1 != tally.count:
            self._uncounted.add(channel)
        elif missing:
            since = [index for index in range(losses, len(self.losses)) if not self.losses[index].attachment]
            self._by_sequence += [(index, channel, missing) for index in since[-1:]]
        self._last[channel] = tally.last, len(self.losses)

    def _take_index(self, body: bytes) -> None:
        """A message index: that of a chunk that is lost tells how many messages it had."""
        channel, size = struct.unpack_from("<HI", body)
        if self._indexes_to_come.pop(channel, None) == size // 16 or not self.losses:
            return
        loss = self.losses[-1]
        if self._places[-1].kind != 0:
            return
        times = struct.unpack_from(f"<{size // 8}Q", body, 6)[::2]
        if times:
            loss.start_ns = min(times) if loss.start_ns is None else min(loss.start_ns, *times)
            loss.end_ns = max(times) if loss.end_ns is None else max(loss.end_ns, *times)
        loss.chunks = max(loss.chunks, 1)
        self._by_index[len(self.losses) - 1, channel] += len(times)

    def _take_attachment(self, body: bytes, at: int, end: int) -> None:
        if body[-4:] != bytes(4) and not _has_crc(body):
            known = None if self._summary is None else self._summary.attachments.get(at)
            name = Attachment.read(ReadDataStream(BytesIO(body))).name if known is None else known.name
            self._lose(Loss(at, end, f"the CRC of attachment {name} does not match", attachment=name))
        else:
            self._places.append(_Place(Opcode.ATTACHMENT, at, end))

    def _take_message(self, body: bytes, at: int, end: int) -> None:
        """A message outside of a chunk. It has no CRC of its own."""
        channel, sequence, _, _ = MESSAGE.unpack_from(body)
        tally = _Tally(sequence)
        tally.count = 1
        self._count(channel, tally)
        self.unchecked += 1
        last = self._places[-1] if self._places else None
        if last is not None and last.kind == Opcode.MESSAGE and last.end == at:
            self._places[-1] = last._replace(end=end)
        else:
            self._places.append(_Place(Opcode.MESSAGE, at, end, has_crc=False))

    # What is lost

    def _lose(self, loss: Loss) -> None:
        self._places.append(_Place(0, len(self.losses), loss.end))
        self.losses.append(loss)

    def _skip(self, at: int, end: int) -> None:
        """There is no record from `at` on; `end` is where the next one is."""
        if self._data_end is not None:
            self.notes.append(f"its summary is damaged at byte {at}")
            return
        head = self._read(at, 64)
        is_chunk = head[:1] == bytes([Opcode.CHUNK])
        if end == self.size:
            loss = Loss(at, end, f"the file ends at byte {at}, in the middle of a record", int(is_chunk))
        else:
            loss = Loss(at, end, f"bytes {at} to {end - 1} are damaged: no record is there", int(is_chunk))
        if is_chunk and len(head) >= HEAD.size + 16:
            loss.start_ns, loss.end_ns = struct.unpack_from("<QQ", head, HEAD.size)
        if self._summary is not None:
            inside = [chunk for place, chunk in self._summary.chunks.items() if at <= place < end]
            loss.chunks = len(inside)
            loss.start_ns = min((chunk.message_start_time for chunk in inside), default=None)
            loss.end_ns = max((chunk.message_end_time for chunk in inside), default=None)
        self._lose(loss)

    def _conclude(self) -> None:
        """Puts together what only the whole file tells."""
        self.has_end = self._data_end is not None or self._summary is not None
        data_is_sound = self._data_is_sound()
        if data_is_sound is not None:
            self.unchecked = 0
        if data_is_sound is False:
            self._drop_what_has_no_crc()
        summary = self._summary
        all_channels = None
        if summary is not None:
            for record in (*summary.schemas, *summary.channels):
                self._descriptions.add(record, True)
            if summary.channels:
                all_channels = {channel.id for channel in summary.channels}
        self.topics = self._descriptions.topics(data_is_sound is True, all_channels)
        self.notes += self._descriptions.notes
        if self._profile not in PROFILES:
            self._check_encodings()
        self._tell_how_many()
        self._drop_undescribed()
        self._tell_when()
        if self._is_all_there():
            self.notes += [loss.why for loss in self.losses]
            self._places = [place for place in self._places if place.kind != 0]
            self.losses = []
        if not self.counts.total() and not (self.has_end and not self.losses):
            raise BadInput(f"{self.path}: no message in it is sound; there is nothing to recover")

    def _data_is_sound(self) -> bool | None:
        """Whether the CRC of the data section matches; None: it has none."""
        if self._data_end is None or self._data_end[1] == 0:
            return None
        end, recorded = self._data_end
        crc = 0
        self._file.seek(0)
        while end > 0:
            data = self._file.read(min(end, _WINDOW))
            crc = zlib.crc32(data, crc)
            end -= len(data)
        return crc == recorded

    def _drop_what_has_no_crc(self) -> None:
        """The only CRC that covers these messages does not match: nothing says which of them are sound."""
        kept: list[_Place] = []
        for place in self._places:
            if place.has_crc:
                kept.append(place)
                continue
            kept.append(_Place(0, len(self.losses), place.end))
            why = f"bytes {place.at} to {place.end - 1}: the CRC of the file's data does not match, and they have no other"
            lost: Counter[int] = Counter()
            for message in self._messages_at(self._file, place):
                lost[message.channel] += 1
            self.counts -= lost
            self.losses.append(Loss(place.at, place.end, why, int(place.kind == Opcode.CHUNK), messages=dict(lost)))
        self._places = kept

    def _check_encodings(self) -> None:
        """Raises BadInput for a recording that is none of ROS 2: its profile says so, and so do its messages."""
        encodings = {topic.message_encoding for topic in self.topics.values()}
        if self._profile is not None and encodings != {"cdr"}:
            raise BadInput(f"{self.path}: its profile is '{self._profile}'; recordings of ROS 2 have 'ros2'")
        self.notes.append("its header is damaged; its messages are those of ROS 2")

    def _tell_how_many(self) -> None:
        for (index, channel), count in self._by_index.items():
            self.losses[index].messages[channel] = count
        for index, channel, count in self._by_sequence:
            if channel not in self._uncounted:
                self.losses[index].messages[channel] = count
                self.losses[index].chunks = max(self.losses[index].chunks, 1)
        for loss in self.losses:
            loss.is_gap = bool(loss.chunks or loss.messages or (self._uncounted and not loss.attachment))

    def _drop_undescribed(self) -> None:
        """Messages of channels that are not described for certain can't be used."""
        for channel in [channel for channel in self.counts if channel not in self.topics]:
            why = self._descriptions.lost.get(channel, f"channel {channel} is not described")
            count = self.counts.pop(channel)
            if count:
                self.losses.append(Loss(0, self.size, f"{count} messages: {why}", messages={channel: count}))

    def _tell_when(self) -> None:
        """Chunk heads have no CRC: times that can't be are not told."""
        for loss in self.losses:
            if loss.start_ns is not None and loss.end_ns is not None and loss.start_ns > loss.end_ns:
                loss.start_ns = loss.end_ns = None

    def _is_all_there(self) -> bool:
        """Whether a sound summary says that nothing is lost but what is of no worth."""
        summary = self._summary
        if summary is None or summary.statistics is None:
            return False
        found = {place.at for place in self._places if place.kind != 0}
        wanted = {*summary.chunks, *summary.attachments, *summary.metadata}
        recorded = {channel: count for channel, count in summary.statistics.channel_message_counts.items() if count}
        return wanted <= found and recorded == {channel: count for channel, count in self.counts.items() if count}

    # What is there

    def _content(self, file: BinaryIO, place: _Place) -> Iterator[Content]:
        if place.kind == 0:
            yield self.losses[place.at]
            return
        if place.kind in (Opcode.CHUNK, Opcode.MESSAGE):
            topics = self.topics
            for message in self._messages_at(file, place):
                if message.channel in topics:
                    yield message
            return
        file.seek(place.at + HEAD.size)
        stream = ReadDataStream(BytesIO(file.read(place.end - place.at - HEAD.size)))
        if place.kind == Opcode.ATTACHMENT:
            yield Attachment.read(stream)
        else:
            record = Metadata.read(stream)
            known = None if self._summary is None else self._summary.metadata.get(place.at)
            yield record if known is None else Metadata(name=known.name, metadata=record.metadata)

    def _messages_at(self, file: BinaryIO, place: _Place) -> Iterator[SoundMessage]:
        if place.kind == Opcode.CHUNK:
            file.seek(place.begin)
            yield from _messages(unpacked(place.codec, file.read(place.end - place.begin), place.size))
            return
        at = place.at
        while at < place.end:
            file.seek(at)
            head = file.read(HEAD.size)
            size = HEAD.unpack(head)[1]
            at += HEAD.size + size
            yield from _messages(head + file.read(size))


def _has_crc(attachment: bytes) -> bool:
    """Whether the CRC of an attachment's body matches."""
    return len(attachment) >= 4 and attachment[-4:] == zlib.crc32(attachment[:-4]).to_bytes(4, "little")


def _walk(data: bytes) -> tuple[dict[int, _Tally], list[Schema | Channel]]:
    """How many messages of which channels a chunk has, and what it describes. Raises struct.error or ValueError."""
    tallies: dict[int, _Tally] = {}
    descriptions: list[Schema | Channel] = []
    offset, end = 0, len(data)
    head, unpack, message_op = HEAD.unpack_from, struct.Struct("<HI").unpack_from, int(Opcode.MESSAGE)
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
                tally = tallies[channel] = _Tally(sequence)
            tally.count += 1
            tally.last = sequence
        elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            if not has_layout(opcode, data, begin, offset):
                raise ValueError("a description is damaged")
            stream = ReadDataStream(BytesIO(data[begin:offset]))
            descriptions.append(Schema.read(stream) if opcode == Opcode.SCHEMA else Channel.read(stream))
    return tallies, descriptions


def _messages(data: bytes) -> Iterator[SoundMessage]:
    """The messages among records that are known to be sound."""
    offset, end = 0, len(data)
    head, unpack, message_op = HEAD.unpack_from, MESSAGE.unpack_from, int(Opcode.MESSAGE)
    begin = HEAD.size + MESSAGE.size
    while offset < end:
        opcode, length = head(data, offset)
        stop = offset + 9 + length
        if opcode == message_op:
            yield SoundMessage(*unpack(data, offset + 9), data[offset + begin : stop])
        offset = stop
