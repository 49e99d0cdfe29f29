"""The example programs run, and print what they promise."""

from __future__ import annotations

import json
import runpy
import sys
from collections.abc import Iterator
from pathlib import Path

import fbql
import pytest
from commands import train
from own_controller import only_ours
from places import ROOT

EXPECTED = {
    "play_a_match": ["3 goals in 3 episodes", "episode 2: goal after", "refused: episodes is 0"],
    "train_a_policy": ["trained: ", "the policy has", "steps per goal (", "p = "],
    "induce_a_tree": ["leaf  0: ", "after 50 trials", "split_cost -0.2: ", "the same match: True"],
    "own_controller": ["bandit: 27 goals in 40 episodes", "values: [", "frozen: 8 goals in 10 episodes"],
    "read_a_recording": [
        "controller fbql, seed 5",
        "episode 3 (learning)",
        "the driver changed",
        "steps; mean weights",
    ],
}


@pytest.fixture(autouse=True)
def registered() -> Iterator[None]:
    """No test leaves a controller behind."""
    with only_ours():
        yield


@pytest.mark.parametrize("name", EXPECTED)
def test_an_example_prints_what_it_promises(
    name: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "argv", [name, *(["8"] if name == "train_a_policy" else [])])
    runpy.run_path(str(ROOT / "examples" / f"{name}.py"), run_name="__main__")
    printed = capsys.readouterr().out
    for text in EXPECTED[name]:
        assert text in printed


def test_the_file_of_a_controller_is_played_by_the_command_and_from_python(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = str(ROOT / "examples" / "own_controller.py")
    words = ["--controller", file, "--episodes", "2", "--max-steps", "200", "--seed", "4", "--set", "bandit_rate=0.5"]
    assert train([*words, "--out", str(tmp_path / "run"), "--json"]) == 0
    digest = json.loads(capsys.readouterr().out)["digest"]
    result = fbql.play(file, episodes=2, max_steps=200, seed=4, parameters={"bandit_rate": 0.5})
    assert result.summary["digest"] == digest
    assert result.policy is not None and result.policy.content.kind == "Bandit"
