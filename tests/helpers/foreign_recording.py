"""A recording of ours with topics of other people's between ours."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from fbql_recording.run import open_run
from mcap.writer import CompressionType, Writer


class ForeignTopic(NamedTuple):
    """A topic as somebody else records it, with one message a step."""

    name: str
    type_name: str = "other/msg/Thing"
    schema_encoding: str = "ros2msg"
    """"" without a schema."""
    schema: bytes = b"string data\n"
    message_encoding: str = "cdr"
    data: bytes = b"\x00\x01\x00\x00\x02\x00\x00\x00a\x00"
    metadata: dict[str, str] = {}  # noqa: RUF012 - nobody changes it
    log_time_ns: int | None = None
    """None: that of ours."""


def with_foreign_topics(source: Path, path: Path, topics: Sequence[ForeignTopic]) -> Path:
    """Writes the messages and attachments of a recording of ours, and those of other topics before each step's."""
    run = open_run(source)
    with path.open("wb") as file:
        writer = Writer(file, compression=CompressionType.LZ4, enable_data_crcs=True)
        writer.start("ros2", "somebody")
        foreign: list[int] = []
        for topic in topics:
            described = 0
            if topic.schema_encoding:
                described = writer.register_schema(topic.type_name, topic.schema_encoding, topic.schema)
            foreign.append(writer.register_channel(topic.name, topic.message_encoding, described, topic.metadata))
        channels: dict[str, int] = {}
        for name, topic in run.topics.items():
            described = writer.register_schema(topic.type_name, topic.schema_encoding, topic.schema.encode())
            channels[name] = writer.register_channel(name, topic.message_encoding, described, topic.metadata)
        for name, data in run.attachments.items():
            writer.add_attachment(0, 0, name, "", data)
        for index, message in enumerate(run.messages()):
            if message.topic == "/world":
                for topic, channel in zip(topics, foreign, strict=True):
                    time_ns = message.log_time_ns if topic.log_time_ns is None else topic.log_time_ns
                    writer.add_message(channel, time_ns, topic.data, time_ns)
            writer.add_message(channels[message.topic], message.log_time_ns, message.data, message.log_time_ns, index)
        writer.finish()
    return path
