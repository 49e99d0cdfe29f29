"""What a run left behind, read with the readers of others: rosbags and mcap."""

from __future__ import annotations

import csv
import hashlib
import json
import struct
from pathlib import Path
from typing import Any, NamedTuple

import yaml
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader


class Message(NamedTuple):
    """A recorded message, decoded by the schema that was recorded with it."""

    topic: str
    type_name: str
    time_ns: int
    fields: Any

    @property
    def at(self) -> tuple[int, int]:
        """Episode and step."""
        return self.fields.episode, self.fields.step


def messages_of(run: Path) -> list[Message]:
    """Every message of a recording, in its order."""
    with AnyReader([run]) as reader:
        return [
            Message(connection.topic, connection.msgtype, time_ns, reader.deserialize(data, connection.msgtype))
            for connection, time_ns, data in reader.messages()
        ]


def finalised(run: Path) -> int:
    """Asserts that a recording is finished: named, described and whole. Gives its number of messages."""
    assert not list(run.glob("*.active")), "the recording is not finished"
    information = yaml.safe_load((run / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    with (run / f"{run.name}_0.mcap").open("rb") as file:
        read = sum(1 for _ in make_reader(file, validate_crcs=True).iter_messages())
    assert read == information["message_count"]
    return read


def summary_of(run: Path) -> dict[str, Any]:
    """summary.json"""
    return json.loads((run / "summary.json").read_text())


def episodes_of(run: Path) -> list[dict[str, str]]:
    """The rows of episodes.csv."""
    with (run / "episodes.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def parameters_of(run: Path) -> dict[str, dict[str, Any]]:
    """The parameters of each node, from config.yaml."""
    return yaml.safe_load((run / "config.yaml").read_text())["parameters"]


def digest_of(messages: list[Message]) -> str:
    """The digest of a run by its definition: world states joined with wheel commands by episode and step."""
    commands = {message.at: message.fields for message in messages if message.topic == "/wheel_command"}
    digest = hashlib.sha256()
    for message in messages:
        if message.topic == "/world":
            world, command = message.fields, commands[message.at]
            digest.update(struct.pack("<qq", world.episode, world.step))
            digest.update(struct.pack("<3d", world.robot_x_m, world.robot_y_m, world.robot_yaw_rad))
            digest.update(struct.pack("<2d", world.ball_x_m, world.ball_y_m))
            digest.update(struct.pack("<2d", command.left_rad_s, command.right_rad_s))
    return digest.hexdigest()
