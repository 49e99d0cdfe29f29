"""`replay.py RUN`: a subscriber in another process hears what was recorded: order, count, bytes, /clock, quality of service."""

from __future__ import annotations

import json
import os
import pty
import select
import signal
import struct
import subprocess
import sys
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator
from pathlib import Path
from time import monotonic
from typing import Any

import pytest
from commands import replay as main
from fbql.cli.interrupts import NUMBERS
from fbql.replay.republish import Outlet
from fbql.replay.topics import ReplayViews
from fbql_recording.bag_metadata import Qos
from fbql_recording.run import open_run
from fbql_sim.views import markers_msg, pose_msgs
from mcap.opcode import Opcode
from mcap.writer import CompressionType, Writer
from patience import PATIENCE_S
from places import ROOT
from rclpy.node import Node
from rclpy.serialization import deserialize_message, serialize_message
from recorded_match import record_match
from replay_listener import padded_hash, read_hash
from rewritten_run import rewrite

LISTENER = ROOT / "tests" / "helpers" / "replay_listener.py"
COMMAND = [sys.executable, "-c", "import sys; from fbql.cli.app import run; sys.exit(run('replay', sys.argv[1:]))"]


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two episodes. Not to be changed."""
    return record_match(tmp_path_factory.mktemp("recorded") / "run", max_steps=100, controller="fbql_literal", guided=0)


@pytest.fixture(autouse=True)
def as_it_was(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """The command's own signal handlers and variables end with the test."""
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    before = {number: signal.getsignal(number) for number in NUMBERS}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


class Listener:
    """A subscriber as a process of its own."""

    def __init__(self, domain: dict[str, str], run: Path, expected: dict[str, int], **options: Any) -> None:
        types = {name: topic.type_name for name, topic in open_run(run).topics.items() if name in expected}
        asked = {"topics": types, "expected": expected, "patience_s": PATIENCE_S, **options}
        self._popen = subprocess.Popen(
            [sys.executable, str(LISTENER), json.dumps(asked)],
            env={**os.environ, **domain},
            stdout=subprocess.PIPE,
            text=True,
        )
        assert self._popen.stdout is not None
        assert select.select([self._popen.stdout], [], [], PATIENCE_S)[0], "the listener did not begin"
        assert self._popen.stdout.readline() == "ready\n"

    def heard(self) -> dict[str, Any]:
        """What came."""
        out, _ = self._popen.communicate(timeout=2 * PATIENCE_S)
        return json.loads(out)

    def close(self) -> None:
        self._popen.kill()
        self._popen.communicate()


@pytest.fixture
def listen(domain: dict[str, str]) -> Iterator[Callable[..., Listener]]:
    made: list[Listener] = []

    def begin(run: Path, expected: dict[str, int], **options: Any) -> Listener:
        made.append(Listener(domain, run, expected, **options))
        return made[-1]

    yield begin
    for listener in made:
        listener.close()


@pytest.fixture
def replay(domain: dict[str, str]) -> Callable[..., int]:
    """The command in this process, in the tests' domain."""

    def run(path: Path, *options: str) -> int:
        return main([str(path), "--domain", domain["ROS_DOMAIN_ID"], "--wait", str(PATIENCE_S), *options])

    return run


def hashes_of(run: Path) -> dict[str, list[str]]:
    """What a listener should hear: of each topic the SHA-256 of each message, in order."""
    found: dict[str, list[str]] = defaultdict(list)
    for message in open_run(run).messages():
        found[message.topic].append(padded_hash(message.data))
    return dict(found)


def stamps_of(run: Path) -> list[int]:
    return [step.stamp_ns for step in open_run(run).steps()]


def test_a_subscriber_hears_every_message_in_order_and_to_the_byte(recorded, listen, replay, capfd):
    expected = hashes_of(recorded)
    stamps = stamps_of(recorded)
    counts = {topic: len(each) for topic, each in expected.items()}
    listener = listen(recorded, {**counts, "/clock": len(stamps)})
    assert replay(recorded, "--rate", "0") == 0
    heard = listener.heard()
    assert {topic: heard[topic] for topic in expected} == expected
    assert heard["/clock"] == stamps
    said = capfd.readouterr().err
    assert f"replayed {sum(counts.values())} messages" in said
    assert "left out" not in said


def test_the_time_waits_for_its_subscribers_as_a_topic_does(recorded, monkeypatch):
    """Whenever its history is full, and in the end."""
    asked: Counter[str] = Counter()
    settle = Outlet.settle

    def counted(outlet: Outlet, deadline_s: float) -> None:
        asked[outlet.publisher.topic_name] += 1
        settle(outlet, deadline_s)

    monkeypatch.setattr(Outlet, "settle", counted)
    assert main([str(recorded), "--rate", "0", "--wait", "0"]) == 0
    steps = len(stamps_of(recorded))
    assert steps > 60
    assert asked["/clock"] == asked["/world"] == (steps - 1) // 20 + 1


def test_json_tells_what_was_replayed_and_nothing_else_on_stdout(recorded, capfd, tmp_path):
    run = rewrite(recorded, tmp_path / "run", lambda message: message.data, type_hash={"/world": "RIHS01_" + "0" * 64})
    assert main([str(run), "--rate", "0", "--wait", "0", "--json"]) == 0
    out = capfd.readouterr().out
    assert out.count("\n") == 1
    found = json.loads(out)
    assert found["left_out"] == ["/world"]
    assert set(found["topics"]) == set(open_run(run).topics) - {"/world"}
    assert found["messages"] == 5 * len(stamps_of(run))
    assert found["replayed_s"] == pytest.approx((stamps_of(run)[-1] - stamps_of(run)[0]) / 1e9)
    assert (found["went_back"], found["late"], found["complete"]) == (0, 0, True)


def test_messages_come_at_the_recorded_rate(recorded, capfd):
    begun_s = monotonic()
    assert main([str(recorded), "--rate", "2", "--duration", "0.5", "--wait", "0"]) == 0
    assert monotonic() - begun_s >= 0.48 / 2
    assert "replayed 180 messages" in capfd.readouterr().err


def test_a_part_of_the_recording_and_of_its_topics_is_replayed(recorded, listen, replay):
    run = open_run(recorded)
    assert run.start_ns is not None
    begin, end = run.start_ns + 500_000_000, run.start_ns + 1_500_000_000
    expected = [padded_hash(message.data) for message in run.messages(["/world"]) if begin <= message.log_time_ns < end]
    assert len(expected) == 60
    listener = listen(recorded, {"/world": len(expected)})
    assert replay(recorded, "--rate", "0", "--start", "0.5", "--duration", "1", "--topics", "world", "--no-clock") == 0
    heard = listener.heard()
    assert heard["/world"] == expected
    assert heard["/clock"] == []


VIEWS = {
    "/robot/pose": "geometry_msgs/msg/PoseStamped",
    "/ball/pose": "geometry_msgs/msg/PoseStamped",
    "/wall/pose": "geometry_msgs/msg/PoseStamped",
    "/simulator/markers": "visualization_msgs/msg/MarkerArray",
}


def views_of(run: Path) -> dict[str, list[str]]:
    """What the simulator would have shown, as a listener hears it."""
    found: dict[str, list[str]] = {topic: [] for topic in VIEWS}
    for step in open_run(run).steps():
        messages = [*pose_msgs(step.world), markers_msg(step.world)]
        for topic, message in zip(VIEWS, messages, strict=True):
            # There and back: some fields have 32 bits on the wire.
            found[topic].append(read_hash(deserialize_message(serialize_message(message), type(message))))
    return found


def test_poses_and_markers_come_as_from_the_simulator_where_somebody_looks(recorded, listen, replay):
    topics = {name: topic.type_name for name, topic in open_run(recorded).topics.items()} | VIEWS
    shown = views_of(recorded)
    counts = {topic: len(each) for topic, each in hashes_of(recorded).items()}
    # Who subscribes is looked at four times a second: the first views may come a moment later than the first steps.
    enough = {topic: len(each) // 2 for topic, each in shown.items()}
    listener = listen(recorded, counts | enough, topics=topics, read=list(VIEWS))
    assert replay(recorded, "--rate", "2") == 0
    heard = listener.heard()
    for topic, expected in shown.items():
        first = expected.index(heard[topic][0])
        assert heard[topic] == expected[first : first + len(heard[topic])]
        assert len(heard[topic]) >= len(expected) // 2


def test_views_that_are_recorded_are_not_made_again_and_without_world_states_there_are_none(recorded, bench):
    node = Node("views", context=bench._context, use_global_arguments=False)

    def made(run: Any, topics: list[str]) -> set[str]:
        before = {publisher.topic_name for publisher in node.publishers}
        ReplayViews(node, run, topics)
        return {publisher.topic_name for publisher in node.publishers} - before

    run = open_run(recorded)
    try:
        assert made(run, ["/wheel_command"]) == set()
        run.topics["/robot/pose"] = run.topics["/world"]
        assert made(run, ["/world"]) == VIEWS.keys() - {"/robot/pose"}
    finally:
        node.destroy_node()


def test_topics_are_offered_as_they_were_recorded(recorded, listen, replay, tmp_path):
    """A topic whose quality of service is not ours: best effort, transient local, with a deadline."""
    odd = Qos(reliability="best_effort", durability="transient_local", depth=3, deadline_ns=5_000_000_000)
    run = rewrite(recorded, tmp_path / "run", lambda message: message.data, qos={"/world": odd})
    listener = listen(run, {"/wheel_command": len(stamps_of(run)), "/world": 1}, reliability="BEST_EFFORT")
    assert replay(run, "--rate", "20", "--topics", "/world", "/wheel_command", "--no-clock") == 0
    offers = listener.heard()["offers"]
    assert offers["/world"] == ["best_effort transient_local deadline 5000000000"]
    assert offers["/wheel_command"][0].startswith("reliable volatile deadline ")


def test_a_recording_by_others_is_replayed(recorded, listen, replay, tmp_path):
    """No quality of service, no type hash, other times, LZ4: what any recorder of the same types may write."""
    run = open_run(recorded)
    path = tmp_path / "foreign.mcap"
    with path.open("wb") as file:
        writer = Writer(file, compression=CompressionType.LZ4)
        writer.start("ros2", "another")
        channels: dict[str, int] = {}
        for name, topic in run.topics.items():
            schema = writer.register_schema(topic.type_name, "ros2msg", topic.schema.encode())
            channels[name] = writer.register_channel(name, "cdr", schema)
        for index, message in enumerate(run.messages()):
            writer.add_message(channels[message.topic], 10**18 + index * 1000, message.data, 10**18 + index * 1000)
        writer.finish()
    expected = hashes_of(path)
    listener = listen(path, {topic: len(each) for topic, each in expected.items()})
    assert replay(path, "--rate", "1", "--no-clock") == 0
    heard = listener.heard()
    assert {topic: heard[topic] for topic in expected} == expected


def test_a_topic_with_another_definition_than_is_installed_is_left_out(recorded, tmp_path, capfd):
    run = rewrite(recorded, tmp_path / "run", lambda message: message.data, type_hash={"/world": "RIHS01_" + "0" * 64})
    assert main([str(run), "--rate", "0", "--wait", "0"]) == 0
    said = capfd.readouterr().err
    assert "left out: /world: fbql_msgs/msg/WorldState was recorded with another definition" in said
    assert f"replayed {5 * len(stamps_of(run))} messages" in said


def test_a_domain_of_its_own_is_taken_unless_one_is_named(recorded, domain, capfd):
    assert main([str(recorded), "--rate", "0", "--wait", "0"]) == 0
    said = capfd.readouterr().err
    assert "in ROS_DOMAIN_ID=" in said
    assert f"in ROS_DOMAIN_ID={domain['ROS_DOMAIN_ID']}:" not in said


def test_a_domain_in_which_the_same_is_published_is_refused(recorded, replay, bench, capfd):
    from fbql_msgs.msg import WorldState

    other = Node("simulator", context=bench._context, use_global_arguments=False)
    publisher = other.create_publisher(WorldState, "/world", 10)
    try:
        assert replay(recorded, "--rate", "0") == 2
    finally:
        other.destroy_publisher(publisher)
        other.destroy_node()
    assert "another node publishes /world in ROS_DOMAIN_ID=" in capfd.readouterr().err


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--rate", "-1"], "--rate -1: must be 0 or more"),
        (["--rate", "nan"], "--rate nan"),
        (["--start", "1000"], "--start 1000: the recording is"),
        (["--topics", "/nothing"], "it has no topic /nothing; it has /behaviors/approaching"),
        (["--domain", "233"], "a domain is a number from 0 to 232"),
    ],
)
def test_what_cannot_be_replayed_is_one_line(recorded, capfd, options, says):
    assert main([str(recorded), *options]) == 2
    said = capfd.readouterr().err
    assert says in said
    assert said.count("\n") == 1


# By keyboard


class AtATerminal:
    """The command as a process of its own with a terminal."""

    def __init__(self, domain: dict[str, str], *arguments: str) -> None:
        self._master, slave = pty.openpty()
        self._popen = subprocess.Popen(
            [*COMMAND, *arguments], env={**os.environ, **domain}, stdin=slave, stdout=slave, stderr=slave,
            start_new_session=True, preexec_fn=lambda: __import__("fcntl").ioctl(0, __import__("termios").TIOCSCTTY, 0),
        )  # fmt: skip
        os.close(slave)
        self._said = ""

    def press(self, keys: str) -> None:
        os.write(self._master, keys.encode())

    def until(self, text: str) -> None:
        """Waits until it has said a text since the last wait."""
        deadline = monotonic() + PATIENCE_S
        while text not in self._said:
            assert monotonic() < deadline, f"waited for '{text}' in:\n{self._said}"
            if select.select([self._master], [], [], 0.1)[0]:
                self._said += os.read(self._master, 4096).decode()
        self._said = self._said.partition(text)[2]

    def exit_code(self) -> int:
        return self._popen.wait(PATIENCE_S)

    def close(self) -> None:
        self._popen.kill()
        self._popen.wait()
        os.close(self._master)


@pytest.fixture
def terminal(domain: dict[str, str]) -> Iterator[Callable[..., AtATerminal]]:
    made: list[AtATerminal] = []

    def start(*arguments: str) -> AtATerminal:
        made.append(AtATerminal(domain, *arguments))
        return made[-1]

    yield start
    for each in made:
        each.close()


def test_a_replay_is_paused_and_goes_on_by_keys(recorded, terminal):
    replay = terminal(str(recorded), "--rate", "1", "--wait", "0", "--loop")
    replay.until("space: pause")
    replay.press(" ")
    replay.until("paused")
    replay.press(" ")
    replay.until("messages ")
    replay.press("q")
    replay.until("times real time")
    assert replay.exit_code() == 0


def test_steps_are_what_the_keys_asked_for(recorded, terminal):
    """Waiting for a topic that nobody subscribes to gives time to press: nothing is published before."""
    replay = terminal(str(recorded), "--rate", "1", "--wait", "1", "--topics", "/world")
    replay.until("space: pause")
    replay.press("sss")
    replay.until("3 messages  paused")
    replay.press("q")
    replay.until("replayed 3 messages")
    assert replay.exit_code() == 0


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_a_loop(recorded, domain, number):
    popen = subprocess.Popen(
        [*COMMAND, str(recorded), "--loop", "--wait", "0"],
        env={**os.environ, **domain},
        stderr=subprocess.PIPE,
        text=True,
    )
    assert popen.stderr is not None
    assert "replaying" in popen.stderr.readline()
    popen.send_signal(number)
    _, said = popen.communicate(timeout=PATIENCE_S)
    assert popen.returncode == 0, said
    assert "replayed" in said


# Incomplete recordings


def damaged(run: Path, place: Path) -> Path:
    """The recording as one file with a flipped bit in the middle of its first chunk."""
    data = bytearray(next(run.glob("*.mcap")).read_bytes())
    at, opcode, length = 8, 0, -9
    while opcode != Opcode.CHUNK:
        at += 9 + length
        opcode, length = struct.unpack_from("<BQ", data, at)
    data[at + length // 2] ^= 1
    path = place / "damaged.mcap"
    path.write_bytes(data)
    return path


def test_damage_ends_a_replay_unless_it_is_skipped_and_counted(recorded, tmp_path, capfd):
    path = damaged(recorded, tmp_path)
    assert main([str(path), "--rate", "0", "--wait", "0"]) == 2
    assert "is damaged" in capfd.readouterr().err
    assert main([str(path), "--rate", "0", "--wait", "0", "--skip-corrupt"]) == 3
    assert f"warning: {path}: left out: chunk" in capfd.readouterr().err
    assert main([str(path), "--rate", "0", "--wait", "0", "--skip-corrupt", "--allow-incomplete"]) == 0


def test_a_recording_that_was_cut_off_is_replayed_with_a_warning_before(tmp_path, capfd):
    run = record_match(tmp_path / "run", close=False)
    assert main([str(run), "--rate", "0", "--wait", "0"]) == 3
    said = capfd.readouterr().err
    assert said.index("cut off at byte") < said.index("replaying ")
    assert f"replayed {sum(open_run(run).counts.values())} messages" in said
