"""Whatever a bag of another robot holds: it is read, or refused in one line, in little time and memory."""

from __future__ import annotations

import sqlite3
import struct
from collections.abc import Callable
from pathlib import Path

import pytest
import yaml
import zstandard
from fbql_behaviors.bag_reading import Bag, read_bag
from fbql_behaviors.core.bag_spec import spec_of
from fbql_common.core.errors import BadInput
from fuzzing import bounded, dice, odd_bytes, odd_copy, read_or_refused
from mcap.records import Channel, Schema
from mcap_contents import Contents, bytes_of, contents_of, odd_contents, records_of
from robot_bags import ODOM, SCAN, SPEC, drive, write_bag

SENSED = spec_of(yaml.safe_load(SPEC))
MERGED = "a0: &a0 {k: 1}\n" + "".join(f"a{i}: &a{i} {{<<: [{', '.join([f'*a{i - 1}'] * 9)}]}}\n" for i in range(1, 9))
"""A text of 400 bytes that stands for 43 million values."""
QOS = "offered_qos_profiles"
PARTS = "=" * 80
Change = Callable[[Contents], None]


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Not to be changed."""
    return write_bag(tmp_path_factory.mktemp("bags") / "drive", drive(1, 30).messages)


@pytest.fixture(scope="module")
def database(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same in SQLite, each message compressed. Not to be changed."""
    return write_bag(tmp_path_factory.mktemp("bags") / "drive", drive(1, 30).messages, "sqlite3", compress=True)


def zeros(size: int) -> bytes:
    """A zstd frame of so many zeros."""
    packer, block = zstandard.ZstdCompressor().compressobj(), bytes(2**24)
    return b"".join([*(packer.compress(block) for _ in range(size // len(block))), packer.flush()])


def mcap_of(bag: Path) -> Path:
    (file,) = bag.glob("*.mcap")
    return file


def changed(bag: Path, place: Path, change: Change) -> Path:
    """A sound MCAP file with other contents."""
    contents = contents_of(mcap_of(bag).read_bytes())
    change(contents)
    place.write_bytes(bytes_of(contents))
    return place


def schema(type_name: str, encoding: str, data: bytes, name: str = "") -> Change:
    """Describes a type in another way, or under another name."""

    def change(contents: Contents) -> None:
        for record in records_of(contents):
            if isinstance(record, Schema) and record.name == type_name:
                record.encoding, record.data, record.name = encoding, data, name or record.name

    return change


def more_fields(text: str, definitions: str = "") -> Change:
    """Scans have more fields."""

    def change(contents: Contents) -> None:
        for record in records_of(contents):
            if isinstance(record, Schema) and record.name == SCAN:
                own, mark, others = record.data.decode().partition(PARTS)
                record.data = f"{own}{text}\n{mark}{others}{definitions}".encode()

    return change


def quality(text: str) -> Change:
    def change(contents: Contents) -> None:
        for record in records_of(contents):
            if isinstance(record, Channel):
                record.metadata[QOS] = text

    return change


DOUBLED = "".join(f"\n{PARTS}\nMSG: a/T{i}\na/T{i + 1} x\na/T{i + 1} y" for i in range(40))
ENDLESS: dict[str, tuple[Change, str]] = {
    "a quality of service of merge keys": (quality(MERGED), "line 2"),
    "arrays of a hundred million messages": (more_fields("std_msgs/Header[100000000] many"), "more than 100000 parts"),
    "arrays of arrays": (
        more_fields("a/A[1000] many", f"\n{PARTS}\nMSG: a/A\na/B[1000] many\n{PARTS}\nMSG: a/B\nstring[1000] many"),
        "more than 100000 parts",
    ),
    "a trillion messages in forty types": (
        more_fields("a/T0 many", f"{DOUBLED}\n{PARTS}\nMSG: a/T40\nuint8 x"),
        "more than 100000 parts",
    ),
    "a type within itself": (more_fields("a/T0 many", f"\n{PARTS}\nMSG: a/T0\na/T0 x"), "damaged"),
}


@pytest.mark.parametrize("kind", ENDLESS)
def test_what_would_have_no_end_is_refused(bag: Path, tmp_path: Path, kind: str) -> None:
    change, says = ENDLESS[kind]
    with bounded(), pytest.raises(BadInput, match=says):
        read_bag(changed(bag, tmp_path / "odd.mcap", change), SENSED)


@pytest.mark.parametrize("text", [MERGED, "[" * 100_000, "!!bool foo", "!!timestamp x", '!!int ""', "a: 1\na: 2"])
def test_metadata_is_plain_data(bag: Path, tmp_path: Path, text: str) -> None:
    copy = tmp_path / "bag"
    copy.mkdir()
    (copy / "bag.mcap").write_bytes(mcap_of(bag).read_bytes())
    (copy / "metadata.yaml").write_text(text)
    with bounded(), pytest.raises(BadInput, match=r"damaged, or not a ROS 2 bag .*YAML: line"):
        read_bag(copy, SENSED)


def test_a_chunk_that_unpacks_to_gigabytes_is_refused(bag: Path, tmp_path: Path) -> None:
    data, size = mcap_of(bag).read_bytes(), 2**32
    head = data[: 17 + struct.unpack_from("<Q", data, 9)[0]]
    packed = zeros(2**28)
    chunk = struct.pack("<QQQI", 0, 1, size, 0) + b"\x04\0\0\0zstd" + struct.pack("<Q", len(packed)) + packed
    end = b"\x0f" + struct.pack("<QI", 4, 0) + b"\x02" + struct.pack("<QQQI", 20, 0, 0, 0) + data[:8]
    path = tmp_path / "bomb.mcap"
    path.write_bytes(head + b"\x06" + struct.pack("<Q", len(chunk)) + chunk + end)
    with bounded(), pytest.raises(BadInput, match="a chunk of 4294967296 bytes; at most 64 MiB are read"):
        read_bag(path, SENSED)


@pytest.mark.parametrize(
    ("statement", "value", "says"),
    [
        (
            "update messages set data=? where topic_id in (select id from topics where name='/scan')",
            zeros(2**28),
            "64 MiB",
        ),
        ("update topics set offered_qos_profiles=?", MERGED, "line 2"),
    ],
    ids=["messages that unpack to gigabytes", "a quality of service of merge keys"],
)
def test_of_a_database_too(database: Path, tmp_path: Path, statement: str, value: object, says: str) -> None:
    copy = tmp_path / "bag"
    copy.mkdir()
    for file in database.iterdir():
        (copy / file.name).write_bytes(file.read_bytes())
    with sqlite3.connect(next(copy.glob("*.db3"))) as connection:
        connection.execute(statement, (value,))
    with bounded(), pytest.raises(BadInput, match=says):
        read_bag(copy, SENSED)


FOREIGN: dict[str, Change] = {
    "protobuf": schema(ODOM, "protobuf", b"\xff\xfe", "foxglove.Log"),
    "JSON": schema(ODOM, "jsonschema", b"{}", "Thing"),
    "bytes for a text": schema(ODOM, "ros2msg", b"\xff\xfe"),
    "no definition": schema(ODOM, "ros2msg", b"this defines nothing!"),
    "no IDL": schema(ODOM, "ros2idl", b"module {{{"),
    "a service": schema(ODOM, "ros2msg", b"int32 x\n", "std_srvs/srv/Trigger_Event"),
    "a name with a line in it": schema(ODOM, "ros2msg", b"int32 x\n", "a/msg/B\x1b[2J\nimport this"),
    "no name": schema(ODOM, "ros2msg", b"int32 x\n"),
}


@pytest.mark.parametrize("kind", FOREIGN)
def test_a_topic_that_is_not_asked_for_may_be_anything(bag: Path, tmp_path: Path, kind: str) -> None:
    assert read_bag(changed(bag, tmp_path / "odd.mcap", FOREIGN[kind]), SENSED) == read_bag(bag, SENSED)


@pytest.mark.parametrize(
    ("encoding", "data", "lacking"),
    [
        ("protobuf", b"\xff\xfe", SCAN),
        ("ros2msg", b"\xff\xfe", SCAN),
        ("ros2idl", b"module {{{", SCAN),
        ("ros2msg", b"geometry_msgs/Elsewhere place", "geometry_msgs/msg/Elsewhere"),
    ],
)
def test_one_that_is_asked_for_has_a_definition(
    bag: Path, tmp_path: Path, encoding: str, data: bytes, lacking: str
) -> None:
    with pytest.raises(BadInput, match=f"message type {lacking} has no ROS definition in this bag"):
        read_bag(changed(bag, tmp_path / "odd.mcap", schema(SCAN, encoding, data)), SENSED)


def read(path: Path) -> Bag | None:
    with bounded():
        return read_or_refused(lambda: read_bag(path, SENSED))


def test_mutated_mcap_files_are_read_or_refused(bag: Path, place: Path) -> None:
    data = mcap_of(bag).read_bytes()
    contents = contents_of(data)
    for number, rng in enumerate(dice(40)):
        path = place / f"{number}.mcap"
        path.write_bytes(odd_bytes(data, rng) if rng.random() < 0.3 else odd_contents(contents, rng)[2])
        read(path)


def test_mutated_metadata_is_read_or_refused(bag: Path, place: Path) -> None:
    said = yaml.safe_load((bag / "metadata.yaml").read_text())
    (place / mcap_of(bag).name).write_bytes(mcap_of(bag).read_bytes())
    for rng in dice(60):
        (place / "metadata.yaml").write_text(yaml.safe_dump(odd_copy(said, rng)))
        read(place)


def test_mutated_databases_are_read_or_refused(database: Path, place: Path) -> None:
    (file,) = database.glob("*.db3")
    data = file.read_bytes()
    (place / "metadata.yaml").write_bytes((database / "metadata.yaml").read_bytes())
    for rng in dice(40):
        (place / file.name).write_bytes(odd_bytes(data, rng))
        read(place)
