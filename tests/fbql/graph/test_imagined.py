"""fbql_model in the graph: the digest and the policy of the match without ROS, and a recording that verifies."""

from __future__ import annotations

import json
from collections.abc import Callable

import numpy as np
import pytest
from bringup_run import Run

COMPILING_S = 300.0
"""How long a match may take that first compiles what imagines."""
MATCH = [
    *("--controller", "fbql_model", "--guided", "2", "--episodes", "4", "--max-steps", "400", "--json"),
    *("--set", "fbql_model_first_episodes=120", "--set", "fbql_model_episodes=60"),
    *("--set", "fbql_model_refit_episodes=2"),
]


@pytest.mark.parametrize(
    ("seed", "processes"), [(1, "many"), (2, "one"), pytest.param(3, "many", marks=pytest.mark.long)]
)
def test_the_graph_and_one_process_without_ros_play_and_learn_the_same_and_the_recording_verifies(
    start: Callable[..., Run], seed: int, processes: str
) -> None:
    words = [*MATCH, "--seed", str(seed)]
    graph = start(*words, "--processes", processes)
    alone = start(*words, script="train.py")
    for run in (graph, alone):
        assert run.exit_code(COMPILING_S) == 0, run.stderr
        assert "can't imagine" not in run.stderr
    assert json.loads(graph.stdout)["digest"] == json.loads(alone.stdout)["digest"]
    with np.load(graph.out / "policy.npz") as one, np.load(alone.out / "policy.npz") as other:
        assert set(one.files) == set(other.files)
        assert all(np.array_equal(one[name], other[name]) for name in one.files)
        assert one["array/imagined_at"] == [4], "what was due at the end is in the policy"
    replay = start(str(graph.out), "--verify", "--json", script="replay.py", out=False)
    assert replay.exit_code() == 0, replay.stderr
    found = json.loads(replay.stdout)
    assert found["identical"]
    assert not found["not_recomputed"]
