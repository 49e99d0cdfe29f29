"""`import fbql`: the same results as the commands, as arrays and objects, without ROS."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import fbql
import numpy as np
import pytest
from commands import induce, train
from fbql_behaviors.storage import load_tree
from fbql_recording.run_directory import EPISODE_COLUMNS
from patience import PATIENCE_S

SUBSUMPTION = ("--controller", "subsumption", "--episodes", "2", "--max-steps", "500", "--seed", "31")
SHORT = {"episodes": 2, "max_steps": 120}


def printed(capsys: pytest.CaptureFixture[str]) -> dict:
    return json.loads(capsys.readouterr().out)


def test_it_is_imported_at_once_and_playing_needs_no_ros_and_no_matplotlib() -> None:
    code = """
import sys, fbql
assert "numpy" not in sys.modules
class Blocked:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in ("rclpy", "matplotlib", "fbql_msgs", "ament_index_python"):
            raise ImportError(name)
sys.meta_path.insert(0, Blocked())
fbql.play("uniform", episodes=1, max_steps=20), fbql.induce("ball_seeking", patterns=30), fbql.open_run
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=PATIENCE_S, check=False)
    assert done.returncode == 0, done.stderr


def test_play_has_the_result_of_the_command_train(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "command"
    assert train([*SUBSUMPTION, "--out", str(out), "--json"]) == 0
    result = fbql.play("subsumption", episodes=2, max_steps=500, seed=31, out=tmp_path / "api")
    without = {"wall_s": 0, "steps_per_s": 0}
    assert {**result.summary, **without} == {**printed(capsys), **without}
    assert (out / "episodes.csv").read_text() == (tmp_path / "api" / "episodes.csv").read_text()
    assert result.path == tmp_path / "api"


def test_episodes_and_steps_are_columns_that_agree(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    result = fbql.play("fbql_literal", guided=1, steps=True, seed=3, **SHORT)
    episodes, steps = result.episodes, result.steps
    assert tuple(episodes) == EPISODE_COLUMNS
    assert episodes["phase"].tolist() == ["guided", "learning", "learning"]
    assert np.bincount(steps["episode"]).tolist() == [count + 1 for count in episodes["steps"]]
    assert steps["weights"].shape == (len(steps["step"]), 3)
    assert steps["observation.ball_seeking"].shape == (len(steps["step"]), 2)
    assert steps["collision_begun"].sum() == episodes["collisions_begun"].sum()
    assert list(tmp_path.iterdir()) == [], "no file is written unless out= is given"


def test_a_policy_is_played_on_as_an_object_and_as_a_file(tmp_path: Path) -> None:
    learned = fbql.train("fbql_literal", guided=1, seed=3, **SHORT)
    assert learned.policy is not None
    file = learned.policy.save(tmp_path / "policy.npz")
    digests = {
        fbql.play("fbql_literal", policy=each, seed=4, **SHORT).summary["digest"] for each in (learned.policy, file)
    }
    assert len(digests) == 1
    untrained = fbql.play("fbql_literal", policy="none", seed=4, **SHORT)
    assert untrained.summary["digest"] not in digests


def test_notes_with_a_policy_object_are_those_with_its_file(tmp_path: Path) -> None:
    learned = fbql.train("fbql_literal", guided=1, seed=3, **SHORT).policy
    assert learned is not None
    file = learned.save(tmp_path / "policy.npz")
    given = {"learn": False, "parameters": {"layers": ["ball_seeking"]}, **SHORT}
    notes = [fbql.play("fbql_literal", policy=each, **given).notes for each in (learned, learned.content, file)]
    told = "layers has no effect: it belongs to subsumption, the controller is fbql_literal, and no episode is guided"
    assert notes == [(told,)] * 3


def test_parameters_may_be_sequences_and_numbers_of_numpy() -> None:
    plain = fbql.play(
        "subsumption", episodes=1, seed=4, max_steps=90, parameters={"layers": ["ball_seeking", "wall_avoiding"]}
    )
    for layers in (("ball_seeking", "wall_avoiding"), np.array(["ball_seeking", "wall_avoiding"])):
        given = {"layers": layers, "reward_goal": np.float64(1.0), "fbql_mirror": np.True_}
        found = fbql.play(
            "subsumption",
            episodes=np.int64(1),
            seed=np.uint32(4),
            max_steps=np.int32(90),
            learn=np.True_,
            parameters=given,
        )
        assert found.summary["digest"] == plain.summary["digest"]
    assert fbql.play(np.array("subsumption"), episodes=np.array(1), seed=4, max_steps=90).summary["steps"] == 90
    made = fbql.induce(np.array("ball_seeking"), patterns=np.int64(50), seed=np.int64(3))
    assert made.tree == fbql.induce("ball_seeking", patterns=50, seed=3).tree


def test_a_tree_is_played_as_an_object_and_as_a_file(tmp_path: Path) -> None:
    made = fbql.induce("ball_seeking", patterns=50)
    file = made.save(tmp_path / "ball_seeking.json")
    results = [fbql.play("subsumption", trees={"ball_seeking": each}, **SHORT) for each in (made.tree, file)]
    assert results[0].summary["digest"] == results[1].summary["digest"]
    assert fbql.play("subsumption", **SHORT).summary["digest"] != results[0].summary["digest"]


def test_induce_has_the_result_of_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "tree.json"
    assert induce(["ball_seeking", "--method", "dp", "--patterns", "100", "--out", str(out), "--json"]) == 0
    made = fbql.induce("ball_seeking", method="dp", patterns=100)
    command = printed(capsys)
    assert made.tree == load_tree(out)
    assert (made.leaves, made.rmse_levels, made.value) == (
        command["leaves"],
        command["rmse_levels"],
        command["root_value"],
    )
    assert fbql.induce("ball_seeking", made.patterns, method="dp").tree.leaves == made.tree.leaves
    assert made.explain().count("\n") + 1 == made.leaves


@pytest.mark.parametrize(
    ("call", "reason"),
    [
        (lambda: fbql.play("best"), "'best'"),
        (lambda: fbql.play(episodes=0), "episodes is 0"),
        (lambda: fbql.play(parameters={"weight_gian": 1}), "did you mean"),
        (lambda: fbql.play(policy="missing.npz"), "no such file"),
        (lambda: fbql.play(trees="missing"), "missing"),
        (lambda: fbql.train("uniform", episodes=1, max_steps=10), "does not learn"),
        (lambda: fbql.train(learn=False), "does not learn"),
        (lambda: fbql.induce("dancing"), "dancing"),
        (lambda: fbql.induce("ball_seeking", split_cost=1.0), "split_cost"),
        (lambda: fbql.induce("ball_seeking", depth=3), "no parameter 'depth'"),
        (lambda: fbql.open_run("missing"), "no such run"),
    ],
)
def test_bad_input_is_one_line(call, reason: str) -> None:
    with pytest.raises(fbql.BadInput) as error:
        call()
    assert reason in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("arguments", "start"),
    [
        ({"guided": -1}, "guided is -1"),
        ({"max_steps": 0}, "max_steps "),
        ({"parameters": {"ball_robot_friction": -1.0}}, "ball_robot_friction "),
    ],
)
def test_an_error_names_an_argument_as_python_spells_it(arguments: dict[str, Any], start: str) -> None:
    with pytest.raises(fbql.BadInput) as error:
        fbql.play(**arguments)
    assert str(error.value).startswith(start)


@pytest.mark.parametrize(
    ("call", "text"),
    [
        (lambda: fbql.play(episodes="3"), "episodes is '3'; expected int | None"),
        (lambda: fbql.play(episodes=True), "episodes is True; expected int | None"),
        (lambda: fbql.play(observations="mine.py:Mine"), "observations is 'mine.py:Mine'; expected Sequence[str]"),
        (lambda: fbql.play(parameters={1: 2}), "parameters is {1: 2}; expected Mapping[str, Any] | None"),
        (lambda: fbql.train(7), "controller is 7; expected str"),
        (lambda: fbql.induce("ball_seeking", every=0.5), "every is 0.5; expected int | None"),
        (lambda: fbql.induce("x" * 99), f"unknown behavior '{'x' * 99}'"),
        (lambda: fbql.play(seed=["x" * 99]), f"seed is ['{'x' * 58}...; expected int"),
    ],
)
def test_an_argument_of_another_type_is_refused_with_the_type_that_is_expected(call, text: str) -> None:
    with pytest.raises(fbql.BadInput) as error:
        call()
    assert str(error.value).startswith(text)


def test_an_unknown_name_is_an_attribute_error() -> None:
    assert set(fbql.__all__) <= set(dir(fbql))
    with pytest.raises(AttributeError, match="no attribute 'nonsense'"):
        fbql.nonsense  # noqa: B018
