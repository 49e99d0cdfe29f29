"""Schemas and channels of a damaged MCAP file: every copy of each, and which of them is believed.

A copy that a CRC covers is believed. Of the others one is, as long as no other contradicts it.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

from mcap.records import Channel, Schema

from fbql_analysis.mcap_file import Topic


class Descriptions:
    """All copies of the schemas and channels of one file."""

    def __init__(self) -> None:
        self.notes: list[str] = []
        """What `topics` found damaged, and how it was put right, a line each."""
        self.lost: dict[int, str] = {}
        """Channels that `topics` left out, and why."""
        self._schemas: dict[int, list[tuple[Schema, bool]]] = {}
        self._channels: dict[int, list[tuple[Channel, bool]]] = {}

    def add(self, record: Schema | Channel, is_sound: bool) -> None:
        """Adds a copy; `is_sound`: a CRC covers it, and matches."""
        copies: dict[int, list[Any]] = self._schemas if isinstance(record, Schema) else self._channels
        copy = (record, is_sound)
        if copy not in copies.setdefault(record.id, []):
            copies[record.id].append(copy)

    def topics(self, data_is_sound: bool, all_there_are: Collection[int] | None) -> dict[int, Topic]:
        """The channels that nothing contradicts, by id.

        Args:
            data_is_sound: the CRC of the data section matches: all copies are as they were written.
            all_there_are: ids of all channels, where a sound summary tells them.
        """
        channels = {number: self._one(copies, data_is_sound) for number, copies in self._channels.items()}
        schemas = {number: self._one(copies, data_is_sound) for number, copies in self._schemas.items()}
        found: dict[int, Topic] = {}
        for number, channel in channels.items():
            if all_there_are is not None and number not in all_there_are:
                self.notes.append(f"channel {number} is none of those that the summary tells of; it is left out")
            elif channel is not None and channel.topic in self._sound_under_another_number(number):
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

    def _sound_under_another_number(self, number: int) -> set[str]:
        """Topics of channels that a CRC covers, where none covers channel `number`."""
        sound = {
            other: {copy.topic for copy, is_sound in copies if is_sound} for other, copies in self._channels.items()
        }
        return set() if sound[number] else set[str]().union(*sound.values())

    def _one[Record: (Schema, Channel)](self, copies: list[tuple[Record, bool]], data_is_sound: bool) -> Record | None:
        sound = [record for record, is_sound in copies if is_sound or data_is_sound]
        others = [record for record, is_sound in copies if not (is_sound or data_is_sound)]
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
