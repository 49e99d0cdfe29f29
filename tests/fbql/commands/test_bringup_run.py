"""The main job: `python3 scripts/bringup.py --episodes 3 --seed 7 --json`, and all that it leaves behind."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from collections import Counter
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
import yaml
from bringup_run import BEHAVIORS, Run
from fbql_recording.run_directory import EPISODE_COLUMNS
from patience import PATIENCE_S
from places import ROOT
from run_directory_reader import (
    Message,
    digest_of,
    episodes_of,
    finalised,
    messages_of,
    parameters_of,
    summary_of,
)

SUMMARY_KEYS = [
    "controller",
    "seed",
    "episodes",
    "goals",
    "own_goals",
    "timeouts",
    "success_rate",
    "cost_per_goal",
    "mean_steps_per_goal",
    "collisions_begun",
    "collision_steps",
    "steps",
    "wall_s",
    "steps_per_s",
    "digest",
    "messages_recorded",
    "incomplete",
]
TYPES = {
    "/world": "fbql_msgs/msg/WorldState",
    **{f"/behaviors/{name}": "fbql_msgs/msg/BehaviorOutput" for name in BEHAVIORS},
    "/wheel_command": "fbql_msgs/msg/WheelCommand",
    "/fusion/decision": "fbql_msgs/msg/FusionDecision",
}
DT_NS = 1e9 / 60


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Run]:
    """The run that all of these tests look at."""
    place = tmp_path_factory.mktemp("bringup")
    words = ["--episodes", "3", "--seed", "7", "--json", "--out", str(place / "run")]
    # A system ROS is there for those alone who have sourced it.
    run = Run(place, words, from_a_shell="ROS_DISTRO" not in os.environ)
    assert run.exit_code() == 0, run.stderr
    yield run
    run.kill()


@pytest.fixture(scope="module")
def summary(run: Run) -> dict[str, Any]:
    return json.loads(run.stdout)


@pytest.fixture(scope="module")
def messages(run: Run) -> list[Message]:
    return messages_of(run.out)


def test_stdout_is_one_json_object_with_the_keys_of_the_summary(run: Run, summary: dict[str, Any]) -> None:
    assert run.stdout.count("\n") == 1
    assert list(summary) == SUMMARY_KEYS
    assert summary == summary_of(run.out)
    assert "bringing up" in run.stderr


def test_three_episodes_are_played_and_every_message_of_every_step_is_recorded(summary: dict[str, Any]) -> None:
    assert summary["episodes"] == 3 == summary["goals"] + summary["own_goals"] + summary["timeouts"]
    assert summary["success_rate"] == summary["goals"] / 3
    assert summary["steps"] > 100
    assert summary["messages_recorded"] == 6 * (summary["steps"] + 3) >= 5 * summary["steps"]
    assert summary["steps_per_s"] == pytest.approx(summary["steps"] / summary["wall_s"])
    assert (summary["controller"], summary["seed"], summary["incomplete"]) == ("fbql", 7, False)


def test_the_run_directory_is_complete(run: Run) -> None:
    names = {path.name for path in run.out.iterdir()}
    assert names == {
        *("metadata.yaml", "run_0.mcap", "config.yaml", "summary.json", "episodes.csv", "policy.npz"),
        *("trees", "log"),
    }
    shipped = ROOT / "ros2_ws/src/fbql_behaviors/fbql_behaviors/trees"
    for name in BEHAVIORS:
        assert (run.out / "trees" / f"{name}.json").read_bytes() == (shipped / f"{name}.json").read_bytes()
    for name in ("simulator", *BEHAVIORS, "fusion"):
        assert f"[{name}]" in run.log(name)


def test_each_episode_has_a_row_and_the_rows_add_up_to_the_summary(run: Run, summary: dict[str, Any]) -> None:
    rows = episodes_of(run.out)
    assert list(rows[0]) == list(EPISODE_COLUMNS)
    assert [row["index"] for row in rows] == ["0", "1", "2"]
    assert {row["phase"] for row in rows} == {"learning"}
    assert len({row["seed"] for row in rows}) == 3
    assert sum(int(row["steps"]) for row in rows) == summary["steps"]
    assert sum(int(row["collisions_begun"]) for row in rows) == summary["collisions_begun"]
    assert sum(row["outcome"] == "goal" for row in rows) == summary["goals"]


def test_the_configuration_names_every_parameter_of_every_node(run: Run) -> None:
    parameters = parameters_of(run.out)
    assert set(parameters) == {"simulator", "fusion", *BEHAVIORS}
    assert (parameters["fusion"]["episodes"], parameters["fusion"]["seed"]) == (3, 7)
    assert parameters["simulator"]["max_steps"] == 4000
    config = yaml.safe_load((run.out / "config.yaml").read_text())
    assert {"python", "numpy", "mcap"} <= set(config["versions"])
    assert config["git_revision"]


def test_rosbags_reads_every_message_by_the_recorded_schema(summary: dict[str, Any], messages: list[Message]) -> None:
    assert len(messages) == summary["messages_recorded"]
    assert {message.topic: message.type_name for message in messages} == TYPES


def test_the_recording_is_whole_and_its_checksums_hold(run: Run, summary: dict[str, Any]) -> None:
    assert finalised(run.out) == summary["messages_recorded"]


def test_every_step_has_its_six_messages_with_one_stamp(messages: list[Message]) -> None:
    steps: dict[tuple[int, int], list[Message]] = {}
    for message in messages:
        steps.setdefault(message.at, []).append(message)
    lengths = Counter(episode for episode, _ in steps)
    assert sorted(steps) == [(episode, step) for episode in range(3) for step in range(lengths[episode])]
    for of_step in steps.values():
        assert {message.topic for message in of_step} == set(TYPES)
        assert len(of_step) == len(TYPES)
        stamps = {message.fields.header.stamp.sec * 10**9 + message.fields.header.stamp.nanosec for message in of_step}
        assert stamps == {of_step[0].time_ns}
        assert {message.fields.header.frame_id for message in of_step} == {"field"}


def test_simulated_time_goes_on_by_one_step_at_a_time(messages: list[Message]) -> None:
    worlds = [message for message in messages if message.topic == "/world"]
    assert all(after.time_ns - before.time_ns == pytest.approx(DT_NS, abs=1) for before, after in pairwise(worlds))
    assert len(worlds) > 100


def test_the_digest_can_be_computed_again_from_the_recording(summary: dict[str, Any], messages: list[Message]) -> None:
    assert digest_of(messages) == summary["digest"]


def test_the_decision_and_the_command_are_what_the_behaviors_said(messages: list[Message]) -> None:
    """Subsumption: the command is the reference of the behavior that the decision names."""
    outputs = {
        (message.at, message.fields.name): message.fields for message in messages if "behaviors" in message.topic
    }
    ended = {message.at for message in messages if message.topic == "/world" and message.fields.terminated}
    commands = {message.at: message.fields for message in messages if message.topic == "/wheel_command"}
    drivers: Counter[str] = Counter()
    for message in messages:
        if message.topic == "/fusion/decision":
            decision, command = message.fields, commands[message.at]
            assert tuple(decision.joint_state) == tuple(outputs[message.at, name].leaf_id for name in BEHAVIORS)
            name = decision.behaviors[decision.driver]
            drivers[name] += 1
            said = outputs[message.at, name]
            expected = (0.0, 0.0) if message.at in ended else (said.left_rad_s, said.right_rad_s)
            assert (command.left_rad_s, command.right_rad_s) == expected
    assert set(drivers) == set(BEHAVIORS)


def test_the_readers_of_foxglove_read_it_completely(run: Run, summary: dict[str, Any], messages: list[Message]) -> None:
    place = ROOT / "tests/helpers/read_with_node"
    modules = Path(os.environ.get("FBQL_NODE_MODULES", place / "node_modules"))
    node = shutil.which("node")
    if node is None or not (modules / "@mcap/core").is_dir():
        pytest.skip("node or its modules are not there: `npm install` in tests/helpers/read_with_node")
    done = subprocess.run(
        [node, place / "read.cjs", run.out / "run_0.mcap"],
        env={**os.environ, "NODE_PATH": str(modules)},
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    read = json.loads(done.stdout)
    assert read["streamed"] == read["indexed"] == summary["messages_recorded"]
    assert {topic: found["type"] for topic, found in read["topics"].items()} == TYPES
    last = [message for message in messages if message.topic == "/world"][-1].fields
    assert read["topics"]["/world"]["last"]["robot_x_m"] == last.robot_x_m


def test_no_process_is_left(run: Run) -> None:
    assert run.processes() == {}
