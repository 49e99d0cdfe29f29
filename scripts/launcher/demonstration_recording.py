"""Writes demonstrations as a recording that `ros2 bag` accepts; `fbql_behaviors.demonstration_storage` reads it."""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from fbql_behaviors.core.patterns import Demonstration
from fbql_behaviors.demonstration_storage import BEHAVIOR_KEY
from fbql_common.core.errors import BadInput
from fbql_common.core.types import WheelCommand, World
from fbql_common.topics import STEP_QOS, WHEEL_COMMAND, WORLD
from fbql_common.wire import encode_command, encode_world, type_name
from fbql_fusion.bag_metadata import qos_of
from fbql_fusion.message_definitions import schema_text, type_hash
from fbql_fusion.recording import Channel, Recorder

_WORLD, _COMMAND = 0, 1


def save_demonstrations(
    directory: Path, behavior: str, demonstrations: Sequence[Demonstration], about: Mapping[str, object]
) -> bool:
    """Records demonstrations into a new directory; `about` goes with them. False when the disk failed meanwhile.

    Raises BadInput when the directory exists or cannot be made.
    """
    try:
        directory.mkdir(parents=True)
    except FileExistsError:
        raise BadInput(f"{directory} exists; demonstrations are never overwritten, choose another directory") from None
    except OSError as error:
        raise BadInput(f"{directory}: cannot be made ({error.strerror}); choose another directory") from None
    custom_data = {BEHAVIOR_KEY: behavior, **{key: json.dumps(value) for key, value in about.items()}}
    recorder = Recorder(directory, _channels(), custom_data, (), lambda text: print(text, file=sys.stderr))
    for demonstration in demonstrations:
        for world, command in zip(demonstration.worlds, demonstration.commands, strict=True):
            recorder.write(_WORLD, encode_world(world), world.stamp_ns)
            recorder.write(_COMMAND, encode_command(command), command.stamp_ns)
        recorder.flush()
    recorder.close()
    return not recorder.failed


def _channels() -> list[Channel]:
    def share(package: str) -> Path:
        return Path(get_package_share_directory(package))

    return [
        Channel(
            f"/{topic}",
            type_name(kind),
            schema_text(type_name(kind), share),
            type_hash(type_name(kind), share),
            qos_of(STEP_QOS),
        )
        for topic, kind in ((WORLD, World), (WHEEL_COMMAND, WheelCommand))
    ]
