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
from io import BytesIO
from pathlib import Path
from typing import BinaryIO, NamedTuple

from fbql_common.core.errors import BadInput
from fbql_common.core.recording_names import RUN_RECORD
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Metadata, Schema
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
    inner_length,
    unpacked,
)
from fbql_recording.mcap.reader import Topic
from fbql_recording.recovery.channels import Descriptions, Guard
from fbql_recording.recovery.losses import Loss, Losses
from fbql_recording.recovery.records import SoundMessage, Tally, is_sound_attachment, messages, sound_chunk, walk
from fbql_recording.recovery.summary import sound_summary

_WINDOW = 2**20
"""Bytes that are searched at a time."""
_AHEAD = 2**16
"""Bytes behind a place that are looked at to tell whether it is a record."""
# A kind from 1 to 15, and a length of at most MAX_RECORD_BYTES. A message has nothing else to be known by: 5 is left out.
_HEADS = re.compile(rb"(?=[\x01-\x04\x06-\x0f]...[\x00-\x04]\x00{4})", re.DOTALL)


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
        self.notes: list[str] = []
        """What is damaged and costs nothing, a line each."""
        self.topics: dict[int, Topic] = {}
        """By channel id."""
        self.unchecked = 0
        """Chunks, and messages outside of chunks, that have no CRC: whether they are sound can't be told."""
        self.has_end = False
        """Whether the file goes on to the end of its data."""
        self._progress = progress
        self._places: list[_Place] = []
        self._descriptions = Descriptions()
        self._profile: str | None = None
        self._losses = Losses()
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
    def losses(self) -> list[Loss]:
        """What is lost, in the order of the file."""
        return [loss for loss in self._losses.found if loss.chunks or not loss.is_suspected]

    @property
    def counts(self) -> Counter[int]:
        """Sound messages by channel id."""
        return self._losses.counts

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
        if MAX_RECORD_BYTES < length < self.size - begin and self._is_record(self._read(end, _AHEAD), 0, end):
            # Behind it there is a record: its length is right.
            self._lose(Loss(at, end, f"the record at byte {at} is larger than {MAX_RECORD_BYTES >> 20} MiB"))
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
        if chunk_head(body).crc == 0 or sound_chunk(body) is None if is_chunk else not is_sound_attachment(body):
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
            follows_loss = bool(self._places) and self._places[-1].kind == 0
            self._put_in_place(self._losses.take_index(body, at, follows_loss))
        elif opcode == Opcode.ATTACHMENT:
            self._take_attachment(body, at, end)
        elif opcode == Opcode.METADATA:
            self._places.append(_Place(opcode, at, end))
            self._losses.is_numbered |= Metadata.read(stream).name == RUN_RECORD
        elif opcode == Opcode.SCHEMA:
            self._descriptions.add(Schema.read(stream), self._guard)
        elif opcode == Opcode.CHANNEL:
            self._descriptions.add(Channel.read(stream), self._guard)
        elif opcode == Opcode.HEADER and self._profile is None:
            (length,) = struct.unpack_from("<I", body)
            self._profile = body[4 : 4 + length].decode()
        elif opcode == Opcode.DATA_END:
            self._data_end = at, int.from_bytes(body, "little")

    @property
    def _guard(self) -> Guard:
        """What guards what is outside of chunks here."""
        return Guard.DATA if self._data_end is None else Guard.NOTHING

    def _take_chunk(self, body: bytes, at: int, end: int) -> None:
        head = chunk_head(body)
        found = sound_chunk(body)
        if found is None:
            why = "its CRC does not match" if head.codec in CODECS else f"it is compressed by '{head.codec}'"
            self._lose(Loss(at, end, f"the chunk at byte {at} is damaged: {why}", 1, head.start_ns, head.end_ns))
            return
        codec, data = found
        try:
            tallies, descriptions = walk(data)
        except (struct.error, ValueError):
            why = f"the chunk at byte {at} is damaged: its records are no such"
            self._lose(Loss(at, end, why, 1, head.start_ns, head.end_ns))
            return
        for record in descriptions:
            self._descriptions.add(record, Guard.CRC if head.crc else self._guard)
        self.unchecked += head.crc == 0
        self._put_in_place(self._losses.count(tallies, at))
        place = _Place(Opcode.CHUNK, at, end, codec, at + HEAD.size + head.begin, len(data), head.crc != 0)
        self._places.append(place)

    def _take_attachment(self, body: bytes, at: int, end: int) -> None:
        if body[-4:] != bytes(4) and not is_sound_attachment(body):
            known = None if self._summary is None else self._summary.attachments.get(at)
            name = Attachment.read(ReadDataStream(BytesIO(body))).name if known is None else known.name
            self._lose(Loss(at, end, f"the CRC of attachment {name} does not match", attachment=name))
        else:
            self._places.append(_Place(Opcode.ATTACHMENT, at, end))

    def _take_message(self, body: bytes, at: int, end: int) -> None:
        """A message outside of a chunk. It has no CRC of its own."""
        channel, sequence, _, _ = MESSAGE.unpack_from(body)
        self._put_in_place(self._losses.count({channel: Tally(sequence, 1)}, at))
        self.unchecked += 1
        last = self._places[-1] if self._places else None
        if last is not None and last.kind == Opcode.MESSAGE and last.end == at:
            self._places[-1] = last._replace(end=end)
        else:
            self._places.append(_Place(Opcode.MESSAGE, at, end, has_crc=False))

    # What is lost

    def _lose(self, loss: Loss) -> None:
        if loss.chunks:
            self._losses.forget_indexes()
        self._losses.found.append(loss)
        self._put_in_place(loss)

    def _put_in_place(self, loss: Loss | None) -> None:
        """The last loss is here, between what is sound before and after it."""
        if loss is not None:
            self._places.append(_Place(0, len(self._losses.found) - 1, loss.end))

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
                self._descriptions.add(record, Guard.CRC)
            if summary.channels:
                all_channels = {channel.id for channel in summary.channels}
        self.topics = self._descriptions.topics(data_is_sound is True, all_channels)
        self.notes += self._descriptions.notes
        if self._profile not in PROFILES:
            self._check_encodings()
        self._losses.conclude(data_is_sound is True)
        self._drop_undescribed()
        if self._is_all_there():
            self._forgive()
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
            kept.append(_Place(0, len(self._losses.found), place.end))
            why = f"bytes {place.at} to {place.end - 1}: the CRC of the file's data does not match, and they have no other"
            lost: Counter[int] = Counter()
            for message in self._messages_at(self._file, place):
                lost[message.channel] += 1
            self.counts.subtract(lost)
            self._losses.found.append(
                Loss(place.at, place.end, why, int(place.kind == Opcode.CHUNK), messages=dict(lost))
            )
        self._places = kept

    def _check_encodings(self) -> None:
        """Raises BadInput for a recording that is none of ROS 2: its profile says so, and so do its messages."""
        encodings = {topic.message_encoding for topic in self.topics.values()}
        if self._profile is not None and encodings != {"cdr"}:
            raise BadInput(f"{self.path}: its profile is '{self._profile}'; recordings of ROS 2 have 'ros2'")
        self.notes.append("its header is damaged; its messages are those of ROS 2")

    def _drop_undescribed(self) -> None:
        """Messages of channels that are not described for certain can't be used."""
        for channel in [channel for channel in self.counts if channel not in self.topics]:
            why = self._descriptions.lost.get(channel, f"channel {channel} is not described")
            count = self.counts.pop(channel)
            if count:
                # The gap is everywhere: from the first message on.
                self._places.insert(0, _Place(0, len(self._losses.found), 0))
                self._losses.found.append(Loss(0, self.size, f"{count} messages: {why}", messages={channel: count}))

    def _is_all_there(self) -> bool:
        """Whether a sound summary says that nothing is lost but what is of no worth."""
        summary = self._summary
        if summary is None or summary.statistics is None:
            return False
        found = {place.at for place in self._places if place.kind != 0}
        wanted = {*summary.chunks, *summary.attachments, *summary.metadata}
        recorded = {channel: count for channel, count in summary.statistics.channel_message_counts.items() if count}
        return wanted <= found and recorded == {channel: count for channel, count in self.counts.items() if count}

    def _forgive(self) -> None:
        """Nothing is missing: what was damaged was of no worth."""
        self.notes += [loss.why for loss in self.losses if not loss.is_suspected]
        self._places = [place for place in self._places if place.kind != 0]
        self._losses.found.clear()

    # What is there

    def _content(self, file: BinaryIO, place: _Place) -> Iterator[Content]:
        if place.kind == 0:
            yield self._losses.found[place.at]
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
            yield from messages(unpacked(place.codec, file.read(place.end - place.begin), place.size))
            return
        at = place.at
        while at < place.end:
            file.seek(at)
            head = file.read(HEAD.size)
            size = HEAD.unpack(head)[1]
            at += HEAD.size + size
            yield from messages(head + file.read(size))
