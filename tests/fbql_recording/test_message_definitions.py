"""The definitions that are kept for recordings made without ROS are those of the .msg files and of the built workspace."""

from __future__ import annotations

from pathlib import Path

import pytest
from ament_index_python.packages import get_package_share_directory
from fbql_common.core.types import BehaviorOutput, Decision, WheelCommand, World
from fbql_common.wire import encode_command, encode_decision, encode_output, encode_world, type_name
from fbql_recording.message_definitions import definitions_in, step_messages
from places import ROOT

NUMBERS = (12_000_000_345, 3, 2**40)
SAMPLES = [
    (encode_world, World(*NUMBERS, *(0.1 * number for number in range(12)), True, False, True, False, True, True)),
    (encode_output, BehaviorOutput(*NUMBERS, "ball_seeking", -1.5, 2.5, 7, 110, "ab" * 32, True, (0.25, -3.0))),
    (encode_command, WheelCommand(*NUMBERS, -88.0, 88.0)),
    (encode_decision, Decision(*NUMBERS, "fbql", 1, ("a", "bc"), (7, -1), (0.5, -0.5), (1.0, 0.0), -1, -5.0, True, (0.75, 0.25))),
]  # fmt: skip


def test_kept_definitions_are_those_of_the_built_workspace():
    """Where they are not: `python -m fbql_recording.message_definitions`, in a shell of the built workspace."""
    kept = {
        message.type_name: {"schema_text": message.schema_text, "type_hash": message.type_hash}
        for message in step_messages().values()
    }
    assert kept == definitions_in(lambda package: Path(get_package_share_directory(package)))


def test_kept_definitions_begin_with_the_message_files():
    for kind, message in step_messages().items():
        assert message.type_name == type_name(kind)
        path = ROOT / "ros2_ws" / "src" / "fbql_msgs" / "msg" / f"{message.type_name.rpartition('/')[2]}.msg"
        assert message.schema_text.startswith(path.read_text() + "\n" + "=" * 80)


@pytest.mark.parametrize(("encode", "value"), SAMPLES)
def test_messages_are_encoded_without_ros_as_nodes_publish_them(encode, value):
    codec = step_messages()[type(value)].codec
    assert codec.encode(value) == encode(value)
    assert codec.decode(encode(value)) == value
