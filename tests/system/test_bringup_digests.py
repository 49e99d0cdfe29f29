"""Determinism is a promise: the same seed plays the same match in many processes, in one, and without ROS."""

from __future__ import annotations

import json
from collections.abc import Callable

import pytest
from bringup_run import Run

CONTROLLERS = {
    "subsumption": ["--episodes", "2"],
    # Learning, with episodes of every phase and end.
    "fbql_literal": ["--episodes", "2", "--guided", "2", "--max-steps", "700"],
    # Guided episodes that the features are made of, then a batch of episodes that is learned from.
    "fbql": ["--episodes", "4", "--guided", "1", "--max-steps", "400"],
    "fbql_value": ["--episodes", "4", "--guided", "1", "--max-steps", "400"],
}


@pytest.mark.parametrize("controller", CONTROLLERS)
@pytest.mark.parametrize("seed", [1, 2, *(pytest.param(seed, marks=pytest.mark.long) for seed in (3, 4, 5))])
def test_the_same_seed_gives_the_same_digest_everywhere_and_again(
    start: Callable[..., Run], controller: str, seed: int
) -> None:
    match = ["--controller", controller, "--seed", str(seed), "--json", *CONTROLLERS[controller]]
    ways = {
        "many": start(*match),
        "one": start(*match, "--processes", "one"),
        "without ROS": start(*match, script="train.py"),
    }
    if seed == 1:
        ways["again"] = start(*match)
    digests: dict[str, str] = {}
    for way, run in ways.items():
        assert run.exit_code() == 0, f"{way}: {run.stderr}"
        summary = json.loads(run.stdout)
        assert summary["steps"] > 100
        digests[way] = summary["digest"]
    assert len(set(digests.values())) == 1, digests


def test_another_seed_or_controller_gives_another_digest(start: Callable[..., Run]) -> None:
    others = (["--seed", "1"], ["--seed", "2"], ["--seed", "1", "--controller", "uniform"])
    runs = [start(*other, "--episodes", "1", "--max-steps", "200", "--json", script="train.py") for other in others]
    assert [run.exit_code() for run in runs] == [0, 0, 0]
    assert len({json.loads(run.stdout)["digest"] for run in runs}) == 3
