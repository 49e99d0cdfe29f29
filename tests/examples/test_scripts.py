"""The example programs run, and say what they promise."""

from __future__ import annotations

import runpy
import sys

import pytest
from places import ROOT

EXPECTED = {
    "play_a_match": ["3 goals in 3 episodes", "episode 2: goal after", "refused: --episodes is 0"],
    "train_a_policy": ["trained: ", "the policy has", "steps per goal (", "p = "],
    "induce_a_tree": ["leaf  0: ", "after 50 trials", "split_cost -0.2: ", "the same match: True"],
    "read_a_recording": [
        "controller fbql, seed 5",
        "episode 3 (learning)",
        "the driver changed",
        "steps; mean weights",
    ],
}


@pytest.mark.parametrize("name", EXPECTED)
def test_an_example_says_what_it_promises(
    name: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "argv", [name, *(["8"] if name == "train_a_policy" else [])])
    runpy.run_path(str(ROOT / "examples" / f"{name}.py"))
    printed = capsys.readouterr().out
    for text in EXPECTED[name]:
        assert text in printed
