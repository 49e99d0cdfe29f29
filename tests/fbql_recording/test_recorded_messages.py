"""Recordings of the real messages: what rosbags and the mcap package read is what was published, field by field."""

from pathlib import Path

import pytest
from ament_index_python.packages import get_package_share_directory
from builtin_interfaces.msg import Time
from fbql_common.qos import STEP_QOS
from fbql_msgs.msg import BehaviorOutput, FusionDecision, WheelCommand, WorldState
from fbql_recording.bag_metadata import INFINITE_NS, Qos, qos_of
from fbql_recording.message_definitions import schema_text, type_hash
from fbql_recording.recorder import Channel, Recorder
from javascript_reader import read_with_javascript
from mcap.reader import make_reader
from rclpy.duration import Duration
from rclpy.qos import DurabilityPolicy, HistoryPolicy, LivelinessPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import serialize_message
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from std_msgs.msg import Header

TYPES = ["fbql_msgs/msg/WorldState", "fbql_msgs/msg/BehaviorOutput", "fbql_msgs/msg/WheelCommand"]
TYPES.append("fbql_msgs/msg/FusionDecision")
HEADER = Header(stamp=Time(sec=12, nanosec=345), frame_id="field")
STAMP_NS = 12_000_000_345


def share(package: str) -> Path:
    return Path(get_package_share_directory(package))


def channel(topic: str, name: str) -> Channel:
    return Channel(topic, name, schema_text(name, share), type_hash(name, share), qos_of(STEP_QOS))


def messages() -> list[WorldState | BehaviorOutput | WheelCommand | FusionDecision]:
    """One of each type, no field at its default."""
    numbers = {
        name: 0.1 * number
        for number, name in enumerate(WorldState.get_fields_and_field_types(), start=1)
        if WorldState.get_fields_and_field_types()[name] == "double"
    }
    flags = {name: True for name, kind in WorldState.get_fields_and_field_types().items() if kind == "boolean"}
    return [
        WorldState(header=HEADER, episode=3, step=2**40, **numbers, **flags),
        BehaviorOutput(
            header=HEADER, episode=3, step=4, name="ball_seeking", left_rad_s=-1.5, right_rad_s=2.5, leaf_id=7,
            leaf_count=110, tree_hash="ab" * 32, clamped=True, observation=[0.25, -3.0],
        ),
        WheelCommand(header=HEADER, episode=3, step=4, left_rad_s=-88.0, right_rad_s=88.0),
        FusionDecision(
            header=HEADER, episode=3, step=4, controller="fbql", phase=1, behaviors=["a", "bc"], joint_state=[7, -1],
            q=[0.5, -0.5], weights=[1.0, 0.0], driver=-1, reward=-5.0, degraded=True, learned_weights=[0.75, 0.25],
        ),
    ]  # fmt: skip


@pytest.fixture
def published() -> list[bytes]:
    """The bytes of each message. Made once: the middleware leaves whatever was in memory in the padding."""
    return [serialize_message(message) for message in messages()]


@pytest.fixture
def run(tmp_path: Path, published: list[bytes]) -> Path:
    directory = tmp_path / "run"
    directory.mkdir()
    recorder = Recorder(directory, [channel(f"/t{i}", name) for i, name in enumerate(TYPES)], {}, (), pytest.fail)
    for repeat in range(50):
        for index, data in enumerate(published):
            recorder.write(index, data, STAMP_NS + repeat)
    recorder.close()
    return directory


def assert_same(ours: object, theirs: object, where: str) -> None:
    """Compares a generated message with rosbags' object, field by field, however deep."""
    for name, kind in ours.get_fields_and_field_types().items():
        mine, read = getattr(ours, name), getattr(theirs, name)
        if hasattr(mine, "get_fields_and_field_types"):
            assert_same(mine, read, f"{where}.{name}")
        elif kind.startswith("sequence"):
            assert list(mine) == list(read), f"{where}.{name}"
        else:
            assert mine == read, f"{where}.{name}"


def test_rosbags_reads_every_field_with_nothing_but_the_recording(run):
    read = 0
    with Reader(run) as bag:
        store = get_typestore(Stores.EMPTY)
        for connection in bag.connections:
            store.register(get_types_from_msg(connection.msgdef.data, connection.msgtype))
        for connection, time_ns, data in bag.messages():
            index = int(connection.topic[2:])
            assert time_ns == STAMP_NS + read // 4
            assert connection.msgtype == TYPES[index]
            assert_same(messages()[index], store.deserialize_cdr(data, connection.msgtype), connection.msgtype)
            read += 1
    assert read == 200


def test_recorded_type_hash_is_that_of_the_recorded_definition(run):
    """rosbags computes RIHS01 from the schema text alone: text and hash belong together, and to the middleware."""
    with Reader(run) as bag:
        store = get_typestore(Stores.EMPTY)
        for connection in bag.connections:
            store.register(get_types_from_msg(connection.msgdef.data, connection.msgtype))
        assert {c.msgtype: c.digest for c in bag.connections} == {
            name: f"RIHS01_{store.hash_rihs01(name).removeprefix('RIHS01_')}" for name in TYPES
        }


def plain(message: object) -> object:
    """A message as JSON has it: integers of 64 bits as text."""
    values: dict[str, object] = {}
    for name, kind in message.get_fields_and_field_types().items():
        value = getattr(message, name)
        if hasattr(value, "get_fields_and_field_types"):
            values[name] = plain(value)
        elif kind.startswith("sequence"):
            values[name] = list(value)
        else:
            values[name] = str(value) if kind == "int64" else value
    return values


def test_javascript_readers_read_every_field_with_crcs_checked(run):
    """What Foxglove and Lichtblick read with. `npm install --no-package-lock` in the reader's directory enables it."""
    result = read_with_javascript(run / "run_0.mcap")
    assert (result["profile"], result["streamed"], result["indexed"]) == ("ros2", 200, 200)
    for index, message in enumerate(messages()):
        assert result["topics"][f"/t{index}"] == {"type": TYPES[index], "messages": 50, "last": plain(message)}


def test_recorded_bytes_are_the_published_ones(run, published):
    with (run / "run_0.mcap").open("rb") as file:
        recorded = [message.data for _, _, message in make_reader(file, validate_crcs=True).iter_messages()]
    assert recorded == published * 50


def test_quality_of_service_is_recorded_in_rosbag2s_words():
    assert qos_of(STEP_QOS) == Qos(depth=10)
    profile = QoSProfile(
        history=HistoryPolicy.KEEP_ALL,
        reliability=ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL,
        liveliness=LivelinessPolicy.MANUAL_BY_TOPIC,
        deadline=Duration(nanoseconds=100),
        lifespan=Duration(seconds=2),
    )
    qos = qos_of(profile)
    assert (qos.history, qos.reliability, qos.durability) == ("keep_all", "best_effort", "transient_local")
    assert (qos.deadline_ns, qos.lifespan_ns, qos.liveliness_lease_ns) == (100, 2 * 10**9, INFINITE_NS)
    assert qos.liveliness == "manual_by_topic"
