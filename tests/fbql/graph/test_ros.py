"""The graph as ROS tools see it: in real time, and composed by hand from single nodes."""

from __future__ import annotations

import math
import os
import random
import signal
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path
from time import monotonic
from typing import Any

import domain_coordinator
import pytest
import rclpy
from bringup_run import BEHAVIORS, END_S, Run
from fbql_common.qos import STEP_QOS
from fbql_msgs.msg import BehaviorOutput, FusionDecision, WheelCommand, WorldState
from geometry_msgs.msg import PoseStamped
from patience import PATIENCE_S
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.serialization import serialize_message
from rosgraph_msgs.msg import Clock
from run_directory_reader import digest_of, episodes_of, finalised, messages_of, summary_of
from visualization_msgs.msg import MarkerArray

Start = Callable[..., Run]


@pytest.fixture
def domain_id() -> Iterator[int]:
    with domain_coordinator.domain_id() as number:
        yield number


@pytest.fixture
def tool(domain_id: int, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[Node]:
    """A node of somebody else's in the domain."""
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    monkeypatch.setenv("ROS_LOG_DIR", str(tmp_path))
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=domain_id)
    node = rclpy.create_node("tool", context=context)
    yield node
    node.destroy_node()
    context.try_shutdown()


def test_in_real_time_a_second_takes_a_second_and_ros_tools_see_everything(
    start: Start, tool: Node, domain_id: int
) -> None:
    # Reliable and deep, so that a busy machine costs no message. The match is far longer than what is asked for: a tool is
    # not waited for, and DDS took up to 2.3 s to bring it together with the simulator.
    seen: dict[str, list[object]] = {}
    topics = {"/clock": Clock, "/robot/pose": PoseStamped, "/ball/pose": PoseStamped, "/wall/pose": PoseStamped}
    for topic, kind in {**topics, "/simulator/markers": MarkerArray}.items():
        seen[topic] = []
        tool.create_subscription(kind, topic, seen[topic].append, QoSProfile(depth=1000))
    executor = rclpy.executors.SingleThreadedExecutor(context=tool.context)
    executor.add_node(tool)
    match = ("--processes", "one", "--realtime", "1", "--episodes", "2", "--max-steps", "150", "--seed", "3")
    run = start(*match, environment={"ROS_DOMAIN_ID": str(domain_id)})
    deadline = monotonic() + PATIENCE_S
    while run.popen.poll() is None and monotonic() < deadline:
        executor.spin_once(timeout_sec=0.1)
    assert run.exit_code(0) == 0, run.stderr
    summary = summary_of(run.out)
    assert summary["steps"] == 300
    assert 40 <= summary["steps_per_s"] <= 70
    assert finalised(run.out) == summary["messages_recorded"]
    assert digest_of(messages_of(run.out)) == summary["digest"]
    for topic in topics:
        assert len(seen[topic]) > 75, topic
    assert seen["/simulator/markers"]
    stamps = [message.clock.sec * 10**9 + message.clock.nanosec for message in seen["/clock"]]
    # While it waits for the next episode, the simulator says the time again.
    spacings = {later - earlier for earlier, later in pairwise(stamps)} - {0}
    assert {round(spacing * 60 / 1e9, 3) for spacing in spacings} == {1.0}
    assert {message.header.frame_id for message in seen["/robot/pose"]} == {"field"}


def test_an_overload_is_reported_in_the_result_and_in_the_summary(start: Start) -> None:
    """6000 steps a second are asked for: an overload of any machine (fault 31)."""
    run = start("--processes", "one", "--realtime", "100", "--episodes", "5", "--max-steps", "600", "--seed", "3")
    assert run.exit_code() == 0, run.stderr
    missed = summary_of(run.out)["missed_ticks"]
    assert missed > 0
    assert f"{missed}  ticks of real time: the machine was too slow" in run.stdout


def test_steps_that_fusion_did_not_see_are_reported_in_the_result_and_are_not_in_the_recording(start: Start) -> None:
    match = ("--controller", "subsumption", "--realtime", "4", "--episodes", "60", "--max-steps", "120", "--seed", "3")
    run = start(*match)
    run.until_playing()
    fusion = run.nodes()["fusion"]
    os.kill(fusion, signal.SIGSTOP)
    again_s = monotonic() + 2.0  # the world meanwhile goes on to the end of its episode
    run.until(lambda: monotonic() > again_s, "fusion has stood still for a while")
    os.kill(fusion, signal.SIGCONT)
    assert run.exit_code() == 0, run.stderr
    summary = summary_of(run.out)
    unseen = summary["steps_unseen"]
    assert unseen > 0
    assert f"{unseen}  of these steps never reached fusion" in run.stdout
    decided = sum(message.topic == "/fusion/decision" for message in messages_of(run.out))
    assert decided == summary["steps"] + summary["episodes"] - unseen, "each episode also has a world of step 0"


def garbage(kind: type[Any], chance: random.Random) -> bytes:
    """A message on a topic of this type that nobody must act on."""
    message = kind()
    message.header.stamp.sec = 1
    message.header.frame_id = "field"
    choice = chance.choice(["bytes", "cut off", "another frame", "not finite"])
    if choice == "bytes":
        return b"\x00\x01\x00\x00" * chance.randrange(2) + chance.randbytes(chance.randrange(400))
    if choice == "another frame":
        message.header.frame_id = "map"
    elif choice == "not finite":
        for field, kind_of_field in kind.get_fields_and_field_types().items():
            if kind_of_field == "double":
                setattr(message, field, chance.choice([math.nan, math.inf, -math.inf]))
    data = bytes(serialize_message(message))
    return data[: chance.randrange(len(data) - 8)] if choice == "cut off" else data


def test_garbage_on_every_topic_changes_nothing_of_a_match(start: Start, tool: Node, domain_id: int) -> None:
    match = ("--controller", "subsumption", "--episodes", "8", "--seed", "3")
    alone = start(*match, script="train.py")
    types = {"/world": WorldState, "/wheel_command": WheelCommand, "/fusion/decision": FusionDecision}
    types |= {f"/behaviors/{name}": BehaviorOutput for name in BEHAVIORS}
    publishers = [(kind, tool.create_publisher(kind, topic, STEP_QOS)) for topic, kind in types.items()]
    executor = rclpy.executors.SingleThreadedExecutor(context=tool.context)
    executor.add_node(tool)
    run = start(*match, environment={"ROS_DOMAIN_ID": str(domain_id)})
    chance = random.Random(1)
    deadline = monotonic() + PATIENCE_S
    while run.popen.poll() is None and monotonic() < deadline:
        for kind, publisher in publishers:
            publisher.publish(garbage(kind, chance))
        executor.spin_once(timeout_sec=0.01)
    assert run.exit_code(0) == 0, run.stderr
    assert alone.exit_code() == 0
    summary = summary_of(run.out)
    assert summary["digest"] == summary_of(alone.out)["digest"]
    assert not summary["incomplete"]
    assert finalised(run.out) == summary["messages_recorded"]
    heard_by = {"simulator": ["/wheel_command"], "fusion": ["/world", *(f"/behaviors/{name}" for name in BEHAVIORS)]}
    for name, topics in {**heard_by, **{name: ["/world"] for name in BEHAVIORS}}.items():
        log = run.log(name)
        assert "Traceback" not in log
        for topic in topics:
            assert f"dropped a message on {topic}: " in log, name


def test_single_nodes_composed_by_hand_in_a_namespace_play_what_bringup_plays_and_end_with_the_result(
    start: Start, domain_id: int
) -> None:
    environment = {"ROS_DOMAIN_ID": str(domain_id)}
    team = ("--ros-args", "-r", "__ns:=/team")

    def node(package: str, executable: str, *parameters: str) -> Run:
        words = [word for parameter in parameters for word in ("-p", parameter)]
        return start("run", package, executable, *team, *words, script="ros2", out=False, environment=environment)

    simulator = node("fbql_sim", "simulator")
    behaviors = [node("fbql_behaviors", name) for name in BEHAVIORS]
    patient = ("behavior_timeout_s:=0.0", "world_timeout_s:=60.0")  # as in a supervised graph
    fusion = node("fbql_fusion", "fusion", "episodes:=1", "seed:=3", *patient)
    assert fusion.exit_code() == 0, fusion.stderr
    assert "fusion: done: goals 1, episodes 1, success rate 100.0%; run in " in fusion.stderr
    (out,) = (fusion.place / "runs").iterdir()
    summary = summary_of(out)
    assert summary["episodes"] == 1
    launched = start("--episodes", "1", "--seed", "3", script="train.py")
    assert launched.exit_code() == 0
    assert summary["digest"] == summary_of(launched.out)["digest"]
    assert [row["steps"] for row in episodes_of(out)] == [str(summary["steps"])]
    messages = messages_of(out)
    assert {message.topic for message in messages} == {
        *("/team/world", "/team/wheel_command", "/team/fusion/decision"),
        *(f"/team/behaviors/{name}" for name in BEHAVIORS),
    }
    for other, number in zip([simulator, *behaviors], [signal.SIGINT, signal.SIGTERM] * 2, strict=True):
        assert other.popen.poll() is None, other.stderr
        other.send(number)
        assert other.exit_code(END_S) == 0, other.stderr
