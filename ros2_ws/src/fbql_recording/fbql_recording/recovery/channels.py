"""Schemas and channels of a damaged MCAP file: every copy of each, and which of them is believed.

A copy that a CRC covers is believed: that of its chunk, of the summary, or of the whole data section. Of the others one
is, as long as no other contradicts it.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from enum import Enum
from typing import Any

from mcap.records import Channel, Schema

from fbql_recording.mcap.reader import Topic


class Guard(Enum):
    """What guards a copy."""

    CRC = "a CRC of its own, which matches"
    DATA = "the CRC of the data section"
    NOTHING = "nothing"


class Descriptions:
    """All copies of the schemas and channels of one file."""

    def __init__(self) -> None:
        self.notes: list[str] = []
        """What `topics` found damaged, and how it was put right, a line each."""
        self.lost: dict[int, str] = {}
        """Channels that `topics` left out, and why."""
        self._schemas: dict[int, list[tuple[Schema, Guard]]] = {}
        self._channels: dict[int, list[tuple[Channel, Guard]]] = {}

    def add(self, record: Schema | Channel, guard: Guard) -> None:
        """Adds a copy."""
        copies: dict[int, list[Any]] = self._schemas if isinstance(record, Schema) else self._channels
        copy = (record, guard)
        if copy not in copies.setdefault(record.id, []):
            copies[record.id].append(copy)

    def topics(self, data_is_sound: bool, all_there_are: Collection[int] | None) -> dict[int, Topic]:
        """The channels that nothing contradicts, by id.

        Args:
            data_is_sound: the CRC of the data section matches.
            all_there_are: ids of all channels, where a sound summary tells them.
        """
        sound = {Guard.CRC, Guard.DATA} if data_is_sound else {Guard.CRC}
        channels = {number: self._one(copies, sound) for number, copies in self._channels.items()}
        schemas = {number: self._one(copies, sound) for number, copies in self._schemas.items()}
        found: dict[int, Topic] = {}
        for number, channel in channels.items():
            if all_there_are is not None and number not in all_there_are:
                self.notes.append(f"channel {number} is none of those that the summary tells of; it is left out")
            elif channel is not None and channel.topic in self._sound_under_another_number(number, sound):
                self.notes.append(f"the number of a copy of topic {channel.topic} is damaged")
            elif channel is None:
                self.lost[number] = f"channel {number} is described twice, and differently"
            elif channel.schema_id == 0:
                self.lost[number] = f"topic {channel.topic} has no definition of its messages"
            else:
                topic = _topic(channel, schemas)
                if isinstance(topic, Topic):
                    found[number] = topic
                else:
                    self.lost[number] = topic
        return found

    def _sound_under_another_number(self, number: int, guards: set[Guard]) -> set[str]:
        """Topics of channels that a CRC covers, where none covers channel `number`."""
        sound = {
            other: {copy.topic for copy, guard in copies if guard in guards} for other, copies in self._channels.items()
        }
        return set() if sound[number] else set[str]().union(*sound.values())

    def _one[Record: (Schema, Channel)](self, copies: list[tuple[Record, Guard]], guards: set[Guard]) -> Record | None:
        sound = [record for record, guard in copies if guard in guards]
        others = [record for record, guard in copies if guard not in guards]
        if sound:
            for other in others:
                if other != sound[0]:
                    kind = "schema" if isinstance(other, Schema) else "channel"
                    self.notes.append(f"{kind} {other.id} is damaged; a copy of it is taken")
        candidates = sound or others
        return candidates[0] if all(record == candidates[0] for record in candidates) else None


def _topic(channel: Channel, schemas: Mapping[int, Schema | None]) -> Topic | str:
    """The topic, or why there is none."""
    if channel.schema_id not in schemas:
        return f"topic {channel.topic}: the definition of its messages is lost"
    schema = schemas[channel.schema_id]
    if schema is None:
        return f"topic {channel.topic}: schema {channel.schema_id} is described twice, and differently"
    try:
        text = schema.data.decode()
    except UnicodeDecodeError:
        return f"topic {channel.topic}: the definition of its messages is no text"
    return Topic(channel.topic, schema.name, text, dict(channel.metadata), channel.message_encoding, schema.encoding)
