"""`scripts/replay.py` as a process, on a run that `scripts/bringup.py` recorded as a graph of processes; and, in the test's
own, on one that learned for longer."""

from __future__ import annotations

import json
import random
import shutil
from collections.abc import Iterator
from pathlib import Path
from struct import pack

import pytest
from bringup_run import HOSTILE, Run, Terminal, in_namespace
from commands import replay
from fbql_common.wire import decode_decision
from fbql_fusion.shipped import shipped_policy
from fbql_recording.mcap.reader import Message
from fbql_recording.run import open_run
from recorded_match import record_match
from rewritten_run import rewrite
from run_directory_reader import summary_of


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A run that learned, its first episode guided."""
    place = tmp_path_factory.mktemp("bringup")
    words = ["--controller", "fbql", "--guided", "1", "--episodes", "1", "--max-steps", "400", "--seed", "1"]
    run = Run(place, [*words, "--out", str(place / "run")])
    assert run.exit_code() == 0, run.stderr
    yield run.out
    run.kill()


def test_a_run_of_the_graph_is_verified_step_by_step(recorded, start):
    verify = start(str(recorded), "--verify", "--json", script="replay.py", out=False)
    assert verify.exit_code() == 0, verify.stderr
    found = json.loads(verify.stdout)
    assert (found["identical"], found["first_difference"], found["not_recomputed"]) == (True, None, {})
    assert 6 * found["steps"] == summary_of(recorded)["messages_recorded"] > 600
    assert found["digest"] == summary_of(recorded)["digest"]


@pytest.mark.parametrize("mode", [["--verify"], ["--set", "weight_gain=0.05"]])
def test_options_of_the_publishing_are_reported_where_nothing_is_published(recorded, start, mode):
    words = ["--rate", "2", "--start", "1", "--no-clock", "--topics", "world"]
    replay = start(str(recorded), *mode, *words, "--allow-incomplete", script="replay.py", out=False)
    assert replay.exit_code() == 0, replay.stderr
    said = [line for line in replay.stderr.splitlines() if "has no effect" in line]
    assert [line.split()[1] for line in said] == ["--rate", "--start", "--topics", "--no-clock"]


def test_a_run_of_the_graph_is_replayed_onto_ros(recorded, start):
    done = start(str(recorded), "--rate", "0", "--wait", "0", script="replay.py", out=False)
    assert done.exit_code() == 0, done.stderr
    assert f"replayed {sum(open_run(recorded).counts.values())} messages" in done.stderr


def test_a_hostile_environment_costs_a_replay_lines_and_no_message(recorded, start, tmp_path):
    run = shutil.copytree(recorded, tmp_path / "naïve")
    done = start(
        *(str(run), "--rate", "0", "--wait", "0", "--json"),
        script="replay.py",
        out=False,
        before=in_namespace("mount -t tmpfs -o ro tmpfs /dev/shm"),
        environment={**HOSTILE, "TERM": None},
    )
    assert done.exit_code() == 0, done.stderr
    assert json.loads(done.stdout)["messages"] == sum(open_run(recorded).counts.values())
    assert done.stderr.isascii() and "Traceback" not in done.stderr
    for name in ("ROS_LOCALHOST_ONLY", "ROS_DISCOVERY_SERVER", "RMW_IMPLEMENTATION", "shared memory can't be used"):
        assert sum(name in line for line in done.stderr.splitlines()) == 1, done.stderr
    assert r"na\xefve" in done.stderr


def test_a_tiny_terminal_of_no_known_kind_shows_a_replay(recorded, start):
    terminal = Terminal(20, 5)
    words = (str(recorded), "--rate", "4", "--wait", "0", "--json")
    done = start(*words, script="replay.py", out=False, terminal=terminal, environment={**HOSTILE, "TERM": "dumb"})
    assert done.exit_code() == 0, terminal.shown
    assert json.loads(done.stdout)["messages"] == sum(open_run(recorded).counts.values())
    live = max(terminal.lines(), key=len)
    terminal.close()
    assert len(live) > 2
    assert all(len(state) <= 20 for state in live[:-1]), "the last is the line that says how it went"
    assert "Traceback" not in terminal.shown


def test_what_if_tells_json_and_nothing_else_on_stdout(recorded, capsys):
    assert replay([str(recorded), "--set", "weight_gain=0.05", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["changed"] == {"weight_gain": [0.01, 0.05]}


def test_no_run_is_one_line(tmp_path, capsys):
    assert replay([str(tmp_path / "gone"), "--verify"]) == 2
    assert capsys.readouterr().err == f"replay.py: {tmp_path / 'gone'}: no such run or recording\n"


def flipped(message: Message, place: float, bit: int) -> bytes:
    """A decision with one bit of one of its weights flipped, whichever lies there."""
    weights = decode_decision(message.data).weights
    at = message.data.index(pack(f"<{len(weights)}d", *weights))
    data = bytearray(message.data)
    data[at + int(place * 8 * len(weights))] ^= 1 << bit
    return bytes(data)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_of_a_run_that_learned_every_step_is_identical_and_a_flipped_bit_of_a_weight_is_named(tmp_path, capsys, seed):
    learning = {"controller": "fbql", "learn": True, "policy": shipped_policy(), "episodes": 3, "max_steps": 4000}
    run = record_match(tmp_path / "run", seed=seed, **learning)
    steps = [(step.episode, step.step) for step in open_run(run).steps()]
    assert replay([str(run), "--verify", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["identical"], found["steps"], found["not_recomputed"]) == (True, len(steps), {})

    chance = random.Random(seed)
    index, place, bit = chance.randrange(len(steps)), chance.random(), chance.randrange(8)

    def change(message: Message) -> bytes:
        if message.topic != "/fusion/decision":
            return message.data
        decision = decode_decision(message.data)
        is_it = (decision.episode, decision.step) == steps[index]
        return flipped(message, place, bit) if is_it else message.data

    copy = rewrite(run, tmp_path / "flipped", change)
    assert replay([str(copy), "--verify", "--json"]) == 1
    found = json.loads(capsys.readouterr().out)
    difference = found["first_difference"]
    assert (found["identical"], found["steps"], difference["index"]) == (False, index, index)
    assert (difference["episode"], difference["step"]) == steps[index]
    assert difference["what"] == "weights of the decision"
