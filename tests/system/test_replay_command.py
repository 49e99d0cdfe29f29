"""`scripts/replay.py` as a process, on a run that `scripts/bringup.py` recorded as a graph of processes."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import pytest
from bringup_run import Run
from fbql_analysis import open_run
from run_directory_reader import summary_of


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A run that learned, its first episode guided."""
    place = tmp_path_factory.mktemp("bringup")
    words = ["--controller", "fbql", "--guided", "1", "--episodes", "1", "--max-steps", "400", "--seed", "1"]
    run = Run(place, [*words, "--out", str(place / "run")])
    assert run.exit_code() == 0, run.stderr
    yield run.out
    run.close()


def test_a_run_of_the_graph_is_verified_step_by_step(recorded, start):
    verify = start(str(recorded), "--verify", "--json", script="replay.py", out=False)
    assert verify.exit_code() == 0, verify.stderr
    found = json.loads(verify.stdout)
    assert (found["identical"], found["first_difference"], found["not_recomputed"]) == (True, None, {})
    assert 6 * found["steps"] == summary_of(recorded)["messages_recorded"] > 600
    assert found["digest"] == summary_of(recorded)["digest"]


def test_a_run_of_the_graph_is_replayed_onto_ros(recorded, start):
    replay = start(str(recorded), "--rate", "0", "--wait", "0", script="replay.py", out=False)
    assert replay.exit_code() == 0, replay.stderr
    assert f"replayed {sum(open_run(recorded).counts.values())} messages" in replay.stderr


def test_what_if_tells_json_and_nothing_else_on_stdout(recorded, start):
    what_if = start(str(recorded), "--set", "weight_gain=0.05", "--json", script="replay.py", out=False)
    assert what_if.exit_code() == 0, what_if.stderr
    assert json.loads(what_if.stdout)["changed"] == {"weight_gain": [0.01, 0.05]}


def test_no_run_is_one_line(tmp_path, start):
    replay = start(str(tmp_path / "gone"), "--verify", script="replay.py", out=False)
    assert replay.exit_code() == 2
    assert replay.stderr == f"replay.py: {tmp_path / 'gone'}: no such run or recording\n"
