"""Writes demonstrations as a recording that `ros2 bag` accepts; `fbql_behaviors.demonstration_storage` reads it."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from fbql_behaviors.core.patterns import Demonstration
from fbql_behaviors.demonstration_storage import BEHAVIOR_KEY
from fbql_common.core.errors import BadInput
from fbql_common.core.topic_names import WHEEL_COMMAND, WORLD
from fbql_common.core.types import WheelCommand, World
from fbql_common.files import output_directory, remedy, removed_on_failure
from fbql_recording.bag_metadata import Qos
from fbql_recording.message_definitions import step_messages
from fbql_recording.recorder import Channel, Recorder

from fbql.cli.places import is_reserved

PAUSE_NS = 1_000_000_000
"""Time between the demonstrations of `in_sequence` [ns]."""
_WORLD, _COMMAND = 0, 1


def save_demonstrations(
    directory: Path, behavior: str, demonstrations: Sequence[Demonstration], about: Mapping[str, object]
) -> None:
    """Records demonstrations into a new directory, completely or not at all; see `write_demonstrations`.

    Raises:
        BadInput: the directory exists or can't be made.
        OSError: the disk failed meanwhile; nothing is left behind.
    """
    with output_directory(directory.parent):
        make_directory(directory)
        with removed_on_failure(directory):
            write_demonstrations(directory, behavior, demonstrations, about)


def make_directory(directory: Path) -> None:
    """Makes the directory of a recording, unless this process has it from `new_path`. Raises BadInput when it exists or
    cannot be made."""
    try:
        directory.mkdir(parents=True)
    except FileExistsError:
        if is_reserved(directory):
            return
        raise BadInput(f"{directory} exists; demonstrations are never overwritten, choose another directory") from None
    except OSError as error:
        raise BadInput(f"{directory}: cannot be created ({error.strerror}); {remedy(error)}") from None


def write_demonstrations(
    directory: Path,
    behavior: str,
    demonstrations: Sequence[Demonstration],
    about: Mapping[str, object],
) -> None:
    """Records demonstrations into a directory without a recording; `about` is stored with them, each value as JSON.

    Raises:
        BadInput: it can't be written there at all.
        OSError: the disk failed meanwhile; it names the directory, in which no part of the recording is left.
    """
    custom_data = {BEHAVIOR_KEY: behavior, **{key: json.dumps(value) for key, value in about.items()}}
    messages = {f"/{WORLD}": step_messages()[World], f"/{WHEEL_COMMAND}": step_messages()[WheelCommand]}
    channels = [Channel(topic, *definition, Qos()) for topic, definition in messages.items()]
    encode_world, encode_command = (definition.codec.encode for definition in messages.values())
    recorder = Recorder(directory, channels, custom_data, (), lambda _: None)
    for demonstration in demonstrations:
        for world, command in zip(demonstration.worlds, demonstration.commands, strict=True):
            recorder.write(_WORLD, encode_world(world), world.stamp_ns)
            recorder.write(_COMMAND, encode_command(command), command.stamp_ns)
        recorder.flush()
    recorder.close()
    if recorder.failure is not None:
        recorder.active_path.unlink(missing_ok=True)
        raise OSError(recorder.failure.errno, recorder.failure.strerror, str(directory))


def in_sequence(demonstrations: Iterable[Demonstration]) -> list[Demonstration]:
    """The same demonstrations as the episodes 0, 1, ... of one recording, in which time never goes back.

    Those of several recordings, or with some left out, become one that any tool can play from its start to its end.
    """
    made: list[Demonstration] = []
    end_ns = 0
    for episode, demonstration in enumerate(demonstrations):
        shift_ns = end_ns + PAUSE_NS - demonstration.worlds[0].stamp_ns
        worlds = tuple(
            world._replace(episode=episode, stamp_ns=world.stamp_ns + shift_ns) for world in demonstration.worlds
        )
        commands = tuple(
            command._replace(episode=episode, stamp_ns=command.stamp_ns + shift_ns)
            for command in demonstration.commands
        )
        made.append(Demonstration(worlds, commands))
        end_ns = worlds[-1].stamp_ns
    return made
