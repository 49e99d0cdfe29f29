"""Topics of other people's in a recording: each is left out with a line, and everything else is read, replayed, reported."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest
from commands import compare, recover, replay, report
from fbql_recording.run import open_run
from foreign_recording import ForeignTopic, with_foreign_topics
from recorded_match import record_match

DEEP = "[" * 10_000
QOS = """- history: 1
  depth: {depth}
  reliability: {reliability}
  durability: {durability}
  deadline: {deadline}
  lifespan: {{sec: 9223372036, nsec: 854775807}}
  liveliness: 1
  liveliness_lease_duration: {{sec: 9223372036, nsec: 854775807}}
  avoid_ros_namespace_conventions: false
"""


def string(name: str = "/text", **changes: object) -> ForeignTopic:
    """A sound topic of std_msgs/msg/String."""
    return ForeignTopic(name, "std_msgs/msg/String", **changes)  # type: ignore[arg-type]


def string_with(**changes: object) -> ForeignTopic:
    """Offered with another quality of service."""
    usual = {"depth": 10, "reliability": 1, "durability": 2, "deadline": "{sec: 1, nsec: 0}"}
    return string(metadata={"offered_qos_profiles": QOS.format(**{**usual, **changes})})


LEFT_OUT = {
    "in JSON": ForeignTopic("/text", "Thing", "jsonschema", b"{}", "json", b'{"x": 1}'),
    "in JSON, without a schema": ForeignTopic("/text", "", "", b"", "json", b"{}"),
    "in protobuf": ForeignTopic("/text", "foxglove.Log", "protobuf", b"\xff\xfe\x00\x80", "protobuf", b"\xff"),
    "of a type of ours in protobuf": ForeignTopic(
        "/text", "fbql_msgs/msg/WorldState", "protobuf", b"\xff\x80", "protobuf", b"\xff"
    ),
    "of a type of ours in JSON": ForeignTopic("/text", "fbql_msgs/msg/WorldState", "jsonschema", b"{}", "json"),
    "under a name of ours": ForeignTopic("/world", "foxglove.Log", "protobuf", b"\xff\x80", "protobuf", b"\xff"),
    "without a schema": ForeignTopic("/text", "", "", b""),
    "with a binary schema": ForeignTopic("/text", "other/msg/Thing", "omgidl", b"\xff\x80"),
    "of a type that is not installed": ForeignTopic("/text"),
    "of a type in two parts": ForeignTopic("/text", "std_msgs/String"),
    "of a type in four parts": ForeignTopic("/text", "std_msgs/msg/String/x"),
    "of a service's type": ForeignTopic("/text", "std_srvs/srv/Trigger"),
    "of a type that leads elsewhere": ForeignTopic("/text", "../msg/String"),
    "of a type with a newline": ForeignTopic("/text", "std_msgs/msg/String\n"),
    "of a module of Python": ForeignTopic("/text", "this/msg/Zen"),
    "of a type that its package lacks": ForeignTopic("/text", "std_msgs/msg/MultiArrayDimension2"),
    "of an attribute of a package": ForeignTopic("/text", "std_msgs/msg/__builtins__"),
    "of a definition that differs": string(schema=b"int32 data\n"),
    "with an illegal name": string("/a b"),
    "with a relative name": string("text"),
    "without a name": string(""),
    "with a private name": string("~/text"),
    "with a name that is expanded": string("/{node}/text"),
    "with a name of two slashes": string("//text"),
    "with a very long name": string("/" + "x" * 1000),
    "with a name that forges a line": string("/x\nreplay.py: all is well\x1b[2J"),
    "with QoS text nested deeply": string(metadata={"offered_qos_profiles": DEEP}),
    "with QoS text that is no YAML": string(metadata={"offered_qos_profiles": "%"}),
    "with QoS text of tags": string(metadata={"offered_qos_profiles": "- !!bool foo"}),
    "with QoS of another shape": string(metadata={"offered_qos_profiles": "a: b"}),
    "with an endless history that is kept": string_with(depth=2**63, durability=1),
    "with a large history that is kept": string_with(depth=2**31, durability=1),
    "with a depth that is no number": string_with(depth="many"),
    "with an unknown policy": string_with(reliability=17),
    "with a deadline that is none": string_with(deadline="1"),
}


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two short episodes. Not to be changed."""
    return record_match(tmp_path_factory.mktemp("recorded") / "run", max_steps=6, episodes=2, controller="fbql_literal")


def lines_of(capfd: pytest.CaptureFixture[str]) -> tuple[str, list[str]]:
    out, err = capfd.readouterr()
    assert "Traceback" not in err
    return out, err.splitlines()


@pytest.mark.parametrize("kind", LEFT_OUT)
def test_a_topic_that_cannot_be_replayed_is_left_out_with_a_line(recorded, tmp_path, capfd, kind):
    before = set(sys.modules)
    path = with_foreign_topics(recorded, tmp_path / "foreign.mcap", [LEFT_OUT[kind]])
    assert replay([str(path), "--rate", "0", "--wait", "0", "--json"]) == 0
    out, lines = lines_of(capfd)
    assert len([line for line in lines if "left out" in line]) >= 1
    assert len(lines) <= 5
    assert all(line.isprintable() for line in lines)
    assert json.loads(out)["topics"] == list(open_run(recorded).topics)
    assert json.loads(out)["messages"] == sum(open_run(recorded).counts.values())
    assert not {name for name in set(sys.modules) - before if name.split(".")[0] in ("this", "std_srvs")}


def test_every_other_command_reads_what_is_ours(recorded, tmp_path, capfd):
    names = {f"/foreign_{index}" for index in range(len(LEFT_OUT))}
    topics = [
        topic if topic.name == "/world" else topic._replace(name=name)
        for name, topic in zip(sorted(names), LEFT_OUT.values(), strict=True)
    ]
    path = with_foreign_topics(recorded, tmp_path / "foreign.mcap", topics)
    assert list(open_run(path).steps()) == list(open_run(recorded).steps())
    for main, options in (
        (replay, ["--verify"]),
        (report, ["--out", str(tmp_path / "page.html")]),
        (compare, [str(recorded)]),
        (recover, ["--out", str(tmp_path / "recovered")]),
    ):
        assert main([str(path), *options]) == 0
        lines_of(capfd)
    assert list(open_run(tmp_path / "recovered").steps()) == list(open_run(recorded).steps())


def test_a_sound_topic_of_an_installed_type_is_replayed(recorded, tmp_path, capfd):
    topics = [
        string(),
        string("/empty", data=b""),
        string("/odd", data=b"\xff"),
        string_with()._replace(name="/deadline"),
    ]
    path = with_foreign_topics(recorded, tmp_path / "foreign.mcap", topics)
    assert replay([str(path), "--rate", "0", "--wait", "0", "--json"]) == 0
    out, lines = lines_of(capfd)
    assert {topic.name for topic in topics} < set(json.loads(out)["topics"])
    assert not [line for line in lines if "left out" in line]


@pytest.mark.parametrize("log_time_ns", [2**64 - 1, 2**63, 2**31 * 10**9])
def test_a_time_that_no_clock_shows_is_left_out_with_a_line(recorded, tmp_path, capfd, log_time_ns):
    path = with_foreign_topics(recorded, tmp_path / "foreign.mcap", [string(log_time_ns=log_time_ns)])
    assert replay([str(path), "--rate", "0", "--wait", "0", "--json"]) == 0
    out, lines = lines_of(capfd)
    assert json.loads(out)["messages"] == sum(open_run(recorded).counts.values())
    assert len([line for line in lines if "which a ROS clock cannot show; they are left out" in line]) == 1
    assert replay([str(path), "--verify"]) == 0
    assert report([str(path), "--out", str(tmp_path / "page.html")]) == 0
    assert compare([str(path), str(recorded)]) == 0
    lines_of(capfd)


def test_a_type_of_another_package_is_never_imported(recorded, tmp_path, capfd, monkeypatch):
    """Not even a package that Python would find and that has messages."""
    package = tmp_path / "evil"
    (package / "msg").mkdir(parents=True)
    (package / "__init__.py").write_text("raise SystemExit('imported')")
    (package / "msg" / "__init__.py").write_text("class Thing: pass")
    monkeypatch.syspath_prepend(tmp_path)
    path = with_foreign_topics(recorded, tmp_path / "foreign.mcap", [ForeignTopic("/text", "evil/msg/Thing")])
    assert replay([str(path), "--rate", "0", "--wait", "0"]) == 0
    assert [line for line in lines_of(capfd)[1] if "message type evil/msg/Thing is not installed here" in line]
