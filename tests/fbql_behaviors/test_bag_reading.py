"""Bags that another library wrote: both storages, and what is refused in one line."""

from __future__ import annotations

import sys
from collections.abc import Callable
from math import inf, nan, pi
from pathlib import Path
from typing import Any

import pytest
import yaml
from fbql_behaviors.bag_reading import load_spec, read_bag
from fbql_behaviors.core.bag_patterns import patterns_of_bags
from fbql_behaviors.core.bag_spec import Spec, spec_of
from fbql_common.core.errors import BadInput
from robot_bags import BEAMS, ODOM, SCAN, SPEC, STAMPED, TWIST, Drive, drive, odometry, scan, twist, write_bag

SENSED = spec_of(yaml.safe_load(SPEC))


def sensing(**entry: Any) -> Spec:
    """The specification with one observation."""
    return spec_of({**yaml.safe_load(SPEC), "observations": {"it": {"low": 0.0, "high": 9.0, **entry}}})


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_bag(tmp_path_factory.mktemp("bags") / "drive", drive(1, 60).messages)


def test_both_storages_compressed_or_not_give_the_same(bag: Path, tmp_path: Path) -> None:
    messages = drive(1, 60).messages
    expected = read_bag(bag, SENSED)
    assert len(expected.events) == 120
    for name, storage, compress in (("a", "sqlite3", False), ("b", "sqlite3", True), ("c", "mcap", True)):
        assert read_bag(write_bag(tmp_path / name, messages, storage, compress), SENSED) == expected
    assert read_bag(next(bag.glob("*.mcap")), SENSED) == expected, "a file without its metadata.yaml"


@pytest.mark.parametrize("name", ["drive#2", "drive?", "a%41", "100 %", "q\nr", "球"])
@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_a_bag_may_have_any_name(bag: Path, tmp_path: Path, storage: str, name: str) -> None:
    written = write_bag(tmp_path / "drive", drive(1, 60).messages, storage).rename(tmp_path / name)
    assert read_bag(written, SENSED) == read_bag(bag, SENSED)
    (file,) = (each for each in written.iterdir() if each.suffix in (".mcap", ".db3"))
    assert read_bag(file, SENSED) == read_bag(bag, SENSED)


def test_what_is_read_is_what_was_recorded_and_when(bag: Path) -> None:
    messages = drive(1, 60).messages
    events = read_bag(bag, SENSED).events
    scans = [(time_ns, content.ranges) for topic, _, time_ns, content in messages if topic == "/scan"]
    expected = [(time_ns, (float(ranges[:4].min()), float(ranges[8:].min()))) for time_ns, ranges in scans]
    assert [(event.stamp_ns, event.numbers) for event in events if event.topic == "/scan"] == expected
    commands = [(t, (m.linear.x, m.angular.z)) for topic, _, t, m in messages if topic == "/cmd_vel"]
    assert [(event.stamp_ns, event.numbers) for event in events if event.topic == "/cmd_vel"] == commands


def test_stamped_commands_are_read_too(bag: Path, tmp_path: Path) -> None:
    stamped = write_bag(tmp_path / "stamped", drive(1, 60, stamped=True).messages)
    read = read_bag(stamped, SENSED)
    assert read.events == read_bag(bag, SENSED).events
    assert (read.types["/cmd_vel"], read_bag(bag, SENSED).types["/cmd_vel"]) == (STAMPED, TWIST)


def test_a_target_is_seen_from_the_odometry(tmp_path: Path) -> None:
    made = Drive()
    for k in range(20):
        made.add("/odom", ODOM, 10**9 * k, odometry(0, 1.0, 2.0, pi / 2))
        made.add("/cmd_vel", TWIST, 10**9 * k + 1, twist(0.1 * (k % 2), 0.0))
    entry = {"odometry": "/odom", "target": {"x": 4.0, "y": 6.0}}
    content = {**yaml.safe_load(SPEC), "observations": {
        "far": {**entry, "gives": "distance", "high": 9.0}, "side": {**entry, "gives": "bearing"}}}  # fmt: skip
    spec = spec_of(content)
    patterns = patterns_of_bags(spec, [read_bag(write_bag(tmp_path / "odom", made.messages), spec).events]).patterns
    assert patterns.x[0].tolist() == pytest.approx([5.0, -0.6435011087932844])


def test_scans_with_nothing_in_range_are_dropped_unless_inf_counts_as_something(tmp_path: Path) -> None:
    made = Drive()
    for k in range(30):
        made.add("/scan", SCAN, 10**8 * k, scan(0, [inf if k % 3 else 1.0] * BEAMS if k % 5 else [nan] * BEAMS))
        made.add("/cmd_vel", TWIST, 10**8 * k + 1, twist(0.1 * (k % 2), 0.0))
    path = write_bag(tmp_path / "open", made.messages)
    plain, far = (
        sensing(topic="/scan", field="ranges[:].min"),
        sensing(topic="/scan", field="ranges[:].min", inf_as=4.0),
    )
    with pytest.raises(BadInput, match="8 patterns of 30 commands on /cmd_vel, at least 10 are needed"):
        patterns_of_bags(plain, [read_bag(path, plain).events])
    read = patterns_of_bags(far, [read_bag(path, far).events])
    assert (read.dropped, set(read.patterns.x[:, 0].tolist())) == ({"it not finite": 6}, {1.0, 4.0})


REFUSED: dict[str, tuple[Spec, str]] = {
    "no such topic": (
        sensing(topic="/lidar", field="x"),
        "there is no topic /lidar in this bag; it has: /cmd_vel, /odom, /scan",
    ),
    "a command of another type": (
        spec_of(
            {
                "observations": {"it": {"topic": "/scan", "field": "range_min", "low": 0, "high": 1}},
                "command": {"topic": "/odom", "axes": {"linear.x": {"low": 0, "high": 1}}},
            }
        ),
        "the command's topic /odom is of type nav_msgs/msg/Odometry; expected geometry_msgs/msg/Twist or",
    ),
    "no such field": (
        sensing(topic="/scan", field="distances[0:3].min"),
        "there is no 'distances'; it has header, angle_min",
    ),
    "no number": (sensing(topic="/odom", field="pose.pose.position"), "not a number; it has x, y, z"),
    "a text": (sensing(topic="/odom", field="child_frame_id"), "is a text, not a number"),
    "a slice out of range": (
        sensing(topic="/scan", field="ranges[0:72].min"),
        "/scan: field 'ranges[0:72].min': slice [0:72] is empty or out of range, the array has 12 elements",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_a_bag_does_not_have_is_refused_in_one_line(name: str, bag: Path) -> None:
    spec, problem = REFUSED[name]
    with pytest.raises(BadInput) as refused:
        read_bag(bag, spec)
    assert problem in str(refused.value)
    assert str(refused.value).startswith(f"{bag}: ")


def _flip(data: bytes) -> bytes:
    middle = len(data) // 2
    return data[:middle] + bytes([data[middle] ^ 4]) + data[middle + 1 :]


DAMAGE: dict[str, Callable[[bytes], bytes]] = {
    "cut off": lambda data: data[: len(data) // 2],
    "one bit": _flip,
    "empty": lambda data: b"",
    "noise": lambda data: bytes(range(256)) * 40,
}


@pytest.mark.parametrize("damage", DAMAGE)
@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_a_damaged_bag_is_refused_in_one_line(storage: str, damage: str, tmp_path: Path) -> None:
    path = write_bag(tmp_path / "bag", drive(1, 60).messages, storage, compress=storage == "mcap")
    file = next(each for each in path.iterdir() if each.suffix in (".mcap", ".db3"))
    whole = file.read_bytes()
    file.write_bytes(DAMAGE[damage](whole))
    if (storage, damage) == ("sqlite3", "one bit"):  # SQLite has no checksums: a bit in its structure, not in a number
        file.write_bytes(whole[:100] + bytes(4000) + whole[4100:])
    with pytest.raises(BadInput) as refused:
        read_bag(path, SENSED)
    assert str(refused.value).startswith(f"{path}: ")


@pytest.mark.parametrize(
    "metadata", [b"", b"{", b"rosbag2_bagfile_information: {version: 99}", b"a: b", b"\xff\xfe\x00"]
)
def test_damaged_metadata_is_refused_in_one_line(metadata: bytes, tmp_path: Path) -> None:
    path = write_bag(tmp_path / "bag", drive(1, 30).messages)
    (path / "metadata.yaml").write_bytes(metadata)
    with pytest.raises(BadInput, match="damaged"):
        read_bag(path, SENSED)


def test_what_is_no_bag_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="there is no such bag"):
        read_bag(tmp_path / "none", SENSED)
    with pytest.raises(BadInput, match=r"not a bag: it lacks metadata\.yaml"):
        read_bag(tmp_path, SENSED)
    (tmp_path / "a.txt").write_text("text")
    with pytest.raises(BadInput, match="not a ROS 2 bag"):
        read_bag(tmp_path / "a.txt", SENSED)


def test_without_the_library_the_error_names_the_extra(bag: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "rosbags.highlevel", None)
    with pytest.raises(BadInput, match=r"bags need the package rosbags, which is not installed: .*bags"):
        read_bag(bag, SENSED)


def test_a_specification_is_read_from_yaml_and_its_errors_name_the_file(tmp_path: Path) -> None:
    path = tmp_path / "behavior.yaml"
    path.write_text(SPEC)
    assert load_spec(path) == SENSED
    for text, problem in (("a: [", "not YAML"), ("rate: 3", "unknown key 'rate'"), ("", "expected names with values")):
        path.write_text(text)
        with pytest.raises(BadInput, match=f"{path}: .*{problem}"):
            load_spec(path)
    with pytest.raises(BadInput, match="no such file"):
        load_spec(tmp_path / "none.yaml")
