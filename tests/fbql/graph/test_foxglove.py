"""`bringup.py --foxglove`: a client of the Foxglove protocol hears the graph live, and nobody has to listen."""

from __future__ import annotations

import json
import re
import socket
import struct
from collections.abc import Callable
from typing import Any

import pytest
from bringup_run import BEHAVIORS, Run
from fbql_recording.core.decoding import TYPES, MessageCodec
from patience import PATIENCE_S
from rclpy.serialization import deserialize_message
from run_directory_reader import summary_of
from visualization_msgs.msg import MarkerArray

pytest.importorskip("foxglove", reason="an optional extra, which is in requirements/test.txt")
client = pytest.importorskip("websockets.sync.client", reason="it is in requirements/test.txt")

Start = Callable[..., Run]
ADDRESS = re.compile(r"ws://127\.0\.0\.1:\d+")
SUBPROTOCOL = "foxglove.sdk.v1"
MESSAGE = struct.Struct("<BIQ")
"""opcode, subscription, log time"""
ONE = ("--processes", "one")
MATCH = (*ONE, "--realtime", "2", "--episodes", "2", "--max-steps", "300", "--seed", "3", "--foxglove", "0")


def address_of(run: Run) -> str:
    run.until(lambda: ADDRESS.search(run.stderr), "the address")
    found = ADDRESS.search(run.stderr)
    assert found is not None
    return found[0]


def channels_of(connection: Any, expected: int) -> dict[str, dict[str, Any]]:
    """What is advertised, by topic."""
    channels: dict[str, dict[str, Any]] = {}
    while len(channels) < expected:
        message = connection.recv(timeout=PATIENCE_S)
        if isinstance(message, str):
            channels |= {each["topic"]: each for each in json.loads(message).get("channels", [])}
    return channels


def test_a_client_hears_world_states_decisions_and_markers(start: Start) -> None:
    run = start(*MATCH)
    with client.connect(address_of(run), subprotocols=[SUBPROTOCOL], open_timeout=PATIENCE_S) as connection:
        topics = {"/world", "/wheel_command", "/fusion/decision", *(f"/behaviors/{name}" for name in BEHAVIORS)}
        views = {"/robot/pose", "/ball/pose", "/wall/pose", "/simulator/markers", "/clock", "/diagnostics"}
        channels = channels_of(connection, len(topics | views))
        assert channels.keys() == topics | views
        wanted = ["/world", "/fusion/decision", "/simulator/markers"]
        subscriptions = [{"id": index, "channelId": channels[topic]["id"]} for index, topic in enumerate(wanted)]
        connection.send(json.dumps({"op": "subscribe", "subscriptions": subscriptions}))
        heard: dict[str, list[bytes]] = {topic: [] for topic in wanted}
        while min(len(messages) for messages in heard.values()) < 20:
            message = connection.recv(timeout=PATIENCE_S)
            if isinstance(message, bytes):
                opcode, index, _ = MESSAGE.unpack_from(message)
                assert opcode == 1
                heard[wanted[index]].append(message[MESSAGE.size :])
    for topic in wanted[:2]:
        channel = channels[topic]
        assert (channel["encoding"], channel["schemaEncoding"]) == ("cdr", "ros2msg")
        assert channel["schemaName"] in TYPES
        codec: MessageCodec[Any] = MessageCodec(channel["schemaName"], channel["schema"])
        values = [codec.decode(data) for data in heard[topic]]
        steps = [(value.episode, value.step) for value in values]
        assert steps == sorted(set(steps))
    markers = deserialize_message(heard["/simulator/markers"][-1], MarkerArray).markers
    assert {marker.ns for marker in markers} >= {"robot", "ball", "walls"}
    assert run.exit_code() == 0
    assert summary_of(run.out)["episodes"] == 2


def test_the_match_is_the_same_whether_somebody_can_watch_or_not(start: Start) -> None:
    match = ("--episodes", "1", "--max-steps", "200", "--seed", "5")
    runs = [start(*match, "--processes", "one", "--foxglove", "0"), start(*match, script="train.py")]
    assert [run.exit_code() for run in runs] == [0, 0]
    assert summary_of(runs[0].out)["digest"] == summary_of(runs[1].out)["digest"]


def test_a_port_that_is_taken_is_refused_in_one_line_and_nothing_is_started(start: Start) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        run = start("--episodes", "1", "--foxglove", str(taken.getsockname()[1]))
        assert run.exit_code() == 2
    assert "name another port" in run.stderr and run.stderr.count("\n") == 1
    assert not run.out.exists()


def test_without_the_extra_it_says_what_to_install(start: Start, tmp_path) -> None:
    hidden = tmp_path / "hidden"
    hidden.mkdir()
    (hidden / "sitecustomize.py").write_text("import sys\nsys.modules['foxglove'] = None\n")
    run = start("--episodes", "1", "--foxglove", environment={"PYTHONPATH": str(hidden)})
    assert run.exit_code() == 2
    assert "requirements/foxglove.txt" in run.stderr
    assert not run.out.exists()
