"""A recording with something in it changed, and every CRC right all the same."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Mapping
from pathlib import Path

import pytest
from fbql_recording.bag_metadata import Qos
from fbql_recording.mcap.reader import Message
from fbql_recording.recorder import Attachment, Channel, Recorder
from fbql_recording.run import open_run

Change = Callable[[Message], bytes | None]
"""The data of a message afterwards; None leaves it out."""


def rewrite(
    source: Path,
    target: Path,
    change: Change,
    leave_out: tuple[str, ...] = (),
    qos: Mapping[str, Qos] | None = None,
    type_hash: Mapping[str, str] | None = None,
) -> Path:
    """Copies a run, with messages changed, attachments left out, and what is said of topics changed.

    Gives the copy's directory.
    """
    run = open_run(source)
    shutil.copytree(source, target, ignore=shutil.ignore_patterns("*.mcap", "metadata.yaml"))
    channels = [
        Channel(
            topic.name,
            topic.type_name,
            topic.schema,
            (type_hash or {}).get(topic.name, topic.metadata["topic_type_hash"]),
            (qos or {}).get(topic.name, Qos()),
        )
        for topic in run.topics.values()
    ]
    attachments = [Attachment(name, "", data) for name, data in run.attachments.items() if name not in leave_out]
    recorder = Recorder(target, channels, {"behaviors": " ".join(run.behaviors)}, attachments, pytest.fail)
    place = {channel.topic: index for index, channel in enumerate(channels)}
    for message in run.messages():
        data = change(message)
        if data is not None:
            recorder.write(place[message.topic], data, message.log_time_ns)
    recorder.close()
    return target
