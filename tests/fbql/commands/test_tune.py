"""The command that tunes a tree's leaves, in one process; and the ground it practises on."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from commands import tune as main
from fbql.demonstrations.instruct import CLEAR_OF_BALL_M
from fbql.demonstrations.practice import PracticeGround, measure, measuring_seeds
from fbql_behaviors.core.exercises import exercise_of
from fbql_behaviors.storage import load_tree
from fbql_common.core.geometry import ball_distance_and_bearing
from places import ROOT

TREES = ROOT / "ros2_ws" / "src" / "fbql_behaviors" / "fbql_behaviors" / "trees"


def tuned(capsys: pytest.CaptureFixture[str], *options: str) -> dict[str, object]:
    """What the command prints."""
    assert main([*options, "--trees", str(TREES), "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_the_command_writes_a_tuned_tree_and_prints_its_measure_before_and_after(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    out = tmp_path / "deep" / "wall.json"
    told = tuned(capsys, "wall_avoiding", "--episodes", "8", "--starts", "3", "--min-updates", "2", "--out", str(out))
    before, after = load_tree(TREES / "wall_avoiding.json"), load_tree(out)
    assert told["behavior"] == "wall_avoiding"
    assert told["leaves"] == before.leaf_count == after.leaf_count
    assert told["leaves_changed"] == sum(a != b for a, b in zip(before.leaves, after.leaves, strict=True)) > 0
    assert told["path"] == str(out)
    assert told["sha256"] == after.hash
    assert after.origin["tuned_from"] == before.hash
    exercise, ground = exercise_of("wall_avoiding"), PracticeGround("wall_avoiding")
    for key, tree in (("before", before), ("after", after)):
        episodes = measure(tree, exercise, ground, measuring_seeds(1, 3))
        assert told[key] == pytest.approx(sum(1000 * e.collision_steps / e.steps for e in episodes) / 3)


def test_the_same_seed_makes_the_same_tree(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    def sha256(seed: str) -> object:
        options = ("--seed", seed, "--episodes", "30", "--starts", "1", "--min-updates", "1")
        told = tuned(capsys, "ball_seeking", *options, "--out", str(tmp_path / "t.json"))
        assert told["difference_low"] is told["difference_high"] is None  # of one start there is no interval
        return told["sha256"]

    assert sha256("3") == sha256("3")
    assert sha256("3") != sha256("4")


@pytest.mark.parametrize(
    ("options", "what"),
    [
        (["juggling"], "'juggling' has no exercise"),
        (["ball_seeking", "--trees", "nowhere"], "nowhere/ball_seeking.json: no such file"),
        (["ball_seeking", "--trees", str(TREES), "--episodes", "0"], "'episodes' is 0"),
        (["ball_seeking", "--trees", str(TREES), "--discount", "2"], "'discount' is 2.0"),
        (["ball_seeking", "--trees", str(TREES), "--seed", "-1"], "--seed is -1"),
        (["ball_seeking", "--trees", str(TREES), "--starts", "0"], "--starts is 0"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(
    options: list[str], what: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(options) == 2
    told = capsys.readouterr()
    assert told.out == ""
    assert told.err.startswith("tune.py: ")
    assert what in told.err
    assert told.err.count("\n") == 1


def test_a_tree_that_cannot_be_written_is_bad_input(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    options = ["ball_seeking", "--trees", str(TREES), "--episodes", "1", "--starts", "1"]
    assert main([*options, "--out", str(tmp_path / "file" / "t.json")]) == 2
    assert f"tune.py: {tmp_path}/file/t.json: cannot be written (Not a directory)" in capsys.readouterr().err


def test_every_start_is_clear_of_the_ball_and_the_same_for_the_same_seed() -> None:
    ground, other = PracticeGround("ball_seeking"), PracticeGround("ball_seeking")
    for seed in range(60):
        world = ground.reset(seed)
        assert ball_distance_and_bearing(world)[0] >= CLEAR_OF_BALL_M
        assert world[3:] == other.reset(seed)[3:]


def test_trees_are_measured_on_the_same_starts_whatever_was_driven_before() -> None:
    exercise, ground = exercise_of("approaching"), PracticeGround("approaching")
    tree = load_tree(TREES / "approaching.json")
    seeds = measuring_seeds(7, 4)
    once = measure(tree, exercise, ground, seeds)
    measure(tree, exercise, ground, measuring_seeds(8, 1))
    assert measure(tree, exercise, ground, seeds) == once
    assert len(set(seeds) | set(measuring_seeds(8, 4))) == 8
