"""Demonstrations as recordings, and the two commands that make and use them."""

from __future__ import annotations

import json
import re
from math import inf, nan
from pathlib import Path

import pytest
from commands import demonstrate, induce
from fbql.demonstrations.instruct import instruct
from fbql.demonstrations.recording import save_demonstrations
from fbql_behaviors import demonstration_storage
from fbql_behaviors.core.patterns import Demonstration
from fbql_behaviors.demonstration_storage import load_demonstrations
from fbql_behaviors.shipped import shipped_trees
from fbql_behaviors.storage import load_tree
from fbql_common.core.errors import BadInput
from fbql_common.core.types import World
from fbql_common.wire import encode_command, encode_world
from fbql_recording.mcap.reader import McapFile, Message
from fbql_recording.message_definitions import step_messages
from rewritten_run import rewrite
from rosbags.rosbag2 import Reader

BEHAVIOR = "wall_avoiding"


@pytest.fixture(scope="module")
def demonstrations() -> list[Demonstration]:
    return instruct(BEHAVIOR, 3, 4, 15)


@pytest.fixture(scope="module")
def recording(demonstrations: list[Demonstration], tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("demonstrations") / "walls"
    save_demonstrations(directory, BEHAVIOR, demonstrations, {"seed": 3})
    return directory


def test_demonstrations_come_back_as_they_were(demonstrations: list[Demonstration], recording: Path) -> None:
    assert load_demonstrations(recording, BEHAVIOR) == demonstrations
    assert load_demonstrations(recording / "walls_0.mcap", BEHAVIOR) == demonstrations


def test_demonstrations_are_recorded_as_the_bytes_that_nodes_publish(
    demonstrations: list[Demonstration], recording: Path
) -> None:
    worlds = [encode_world(world) for demonstration in demonstrations for world in demonstration.worlds]
    commands = [encode_command(command) for demonstration in demonstrations for command in demonstration.commands]
    messages = list(McapFile(recording / "walls_0.mcap").messages())
    assert [message.data for message in messages if message.topic == "/world"] == worlds
    assert [message.data for message in messages if message.topic == "/wheel_command"] == commands


def test_recordings_below_one_directory_are_merged(
    demonstrations: list[Demonstration], recording: Path, tmp_path: Path
) -> None:
    others = instruct(BEHAVIOR, 4, 2, 5)
    save_demonstrations(tmp_path / "a", BEHAVIOR, demonstrations, {})
    save_demonstrations(tmp_path / "b", BEHAVIOR, others, {})
    assert load_demonstrations(tmp_path, BEHAVIOR) == [*demonstrations, *others]


def test_a_recording_of_demonstrations_is_a_bag_that_other_tools_read(recording: Path) -> None:
    with Reader(recording) as reader:
        counts = {connection.topic: connection.msgcount for connection in reader.connections}
        assert counts == {"/world": 60, "/wheel_command": 60}
        assert sum(1 for _ in reader.messages()) == 120


def test_demonstrations_are_never_overwritten(demonstrations: list[Demonstration], recording: Path) -> None:
    with pytest.raises(BadInput, match="exists; demonstrations are never overwritten"):
        save_demonstrations(recording, BEHAVIOR, demonstrations, {})


def test_demonstrations_of_another_behavior_are_refused(recording: Path) -> None:
    with pytest.raises(BadInput, match=r"walls_0\.mcap: holds demonstrations of 'wall_avoiding', not of 'approaching'"):
        load_demonstrations(recording, "approaching")


def test_a_directory_without_recordings_is_refused_and_makes_no_tree(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Fault 55."""
    with pytest.raises(BadInput, match="no demonstrations there"):
        load_demonstrations(tmp_path, BEHAVIOR)
    assert induce([BEHAVIOR, "--demos", str(tmp_path), "--out", str(tmp_path / "tree.json")]) == 2
    assert "no demonstrations there (no .mcap file)" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("bad", [nan, inf])
def test_a_number_that_is_not_finite_is_refused_with_its_message(bad: float, recording: Path, tmp_path: Path) -> None:
    """Fault 59."""
    codec = step_messages()[World].codec

    def change(message: Message) -> bytes:
        if message.topic != "/world" or (world := codec.decode(message.data)).step != 7:
            return message.data
        return codec.encode(world._replace(robot_x_m=bad))

    reason = r"bad_0\.mcap: message 14, counted from 0: a pose or velocity is not finite"
    with pytest.raises(BadInput, match=reason):
        load_demonstrations(rewrite(recording, tmp_path / "bad", change), BEHAVIOR)


def test_more_steps_than_fit_into_memory_are_refused(recording: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fault 60."""
    monkeypatch.setattr(demonstration_storage, "MAX_STEPS", 50)
    with pytest.raises(BadInput, match=r"more than 50 steps, which would take over .* GiB"):
        load_demonstrations(recording, BEHAVIOR)


def test_wherever_a_recording_is_cut_off_it_is_refused(recording: Path, tmp_path: Path) -> None:
    data = (recording / "walls_0.mcap").read_bytes()
    path = tmp_path / "cut.mcap"
    for size in [0, 4, 8, 100, *range(1000, len(data), len(data) // 20), len(data) - 1]:
        path.write_bytes(data[:size])
        with pytest.raises(BadInput, match=r"cut\.mcap: (the file is empty|cut off|truncated|damaged)"):
            load_demonstrations(path, BEHAVIOR)


def test_what_is_no_recording_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "poem.mcap"
    path.write_text("trees are green, and so is the field")
    with pytest.raises(BadInput, match=r"poem\.mcap: not an MCAP file"):
        load_demonstrations(path, BEHAVIOR)
    with pytest.raises(BadInput, match=r"none\.mcap: no such file"):
        load_demonstrations(tmp_path / "none.mcap", BEHAVIOR)


def test_a_flipped_bit_in_the_data_is_never_read_as_something_else(
    demonstrations: list[Demonstration], recording: Path, tmp_path: Path
) -> None:
    data = bytearray((recording / "walls_0.mcap").read_bytes())
    path = tmp_path / "flipped.mcap"
    refused = 0
    for position in range(1500, len(data) - 1500, len(data) // 40):
        flipped = bytearray(data)
        flipped[position] ^= 0x10
        path.write_bytes(flipped)
        try:
            assert load_demonstrations(path, BEHAVIOR) == demonstrations
        except BadInput as error:
            assert str(path) in str(error)
            refused += 1
    assert refused > 20


def test_demonstrate_then_induce_makes_the_tree_that_ships(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    demos, out = tmp_path / "demos", tmp_path / "wall_avoiding.json"
    assert demonstrate([BEHAVIOR, "--out", str(demos), "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == {"demonstrations": 100, "patterns": 1000, "path": str(demos)}
    assert induce([BEHAVIOR, "--demos", str(demos), "--out", str(out), "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    shipped = load_tree(shipped_trees() / "wall_avoiding.json")
    assert load_tree(out) == shipped
    assert result["leaves"] == shipped.leaf_count
    assert result["rmse_rad_s"] == pytest.approx(result["rmse_levels"] * 88.0 / 14)
    assert 0.0 < result["root_value"] < 5.0
    assert 0.0 < result["seconds"] < 10.0
    assert (result["path"], result["sha256"]) == (str(out), shipped.hash)


@pytest.mark.parametrize("method", ["rl", "dp"])
@pytest.mark.parametrize("objective", ["printed", "weighted"])
def test_every_method_and_objective_induces_a_tree(
    method: str, objective: str, recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "tree.json"
    options = ["--demos", str(recording), "--method", method, "--objective", objective, "--every", "1", "--seed", "3"]
    assert induce([BEHAVIOR, *options, "--out", str(out)]) == 0
    origin = load_tree(out).origin
    assert (origin["method"], origin["objective"], origin["seed"], origin["patterns"]) == (method, objective, 3, 60)
    assert "held-out error" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("command", "arguments", "reason"),
    [
        (demonstrate, ["dance"], "unknown behavior 'dance'|no scripted instructor"),
        (demonstrate, [BEHAVIOR, "--demonstrations", "0"], "demonstrations is 0"),
        (demonstrate, [BEHAVIOR, "--seed", "-1"], "seed is -1"),
        (induce, ["dance"], "'dance'"),
        (induce, [BEHAVIOR, "--demos", "/nowhere"], "/nowhere: no such file"),
        (induce, [BEHAVIOR, "--split-cost", "0.5"], r"parameter 'split_cost' is 0\.5, outside of"),
        (induce, [BEHAVIOR, "--split-cost", "nan"], "parameter 'split_cost' is nan"),
        (induce, [BEHAVIOR, "--every", "0"], "every is 0"),
        (induce, [BEHAVIOR, "--seed", "-1"], "seed is -1"),
    ],
)
def test_bad_input_ends_in_exit_code_2_and_one_line(
    command: object, arguments: list[str], reason: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert command([*arguments, "--out", str(tmp_path / "out")]) == 2  # pyright: ignore
    lines = capsys.readouterr().err.strip().splitlines()
    assert re.search(reason, lines[-1])
    assert not any("Traceback" in line for line in lines)
    assert list(tmp_path.iterdir()) == []
