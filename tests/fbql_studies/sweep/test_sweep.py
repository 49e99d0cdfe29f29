"""A sweep: every combination over the same seeds, each as `train` plays it, and compared with intervals."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from commands import sweep, train
from fbql_common.core.errors import BadInput
from fbql_studies.sweep import study
from own_controller import bandit, only_ours
from studies import tasks_of

QUICK = ("--controller", "subsumption", "--episodes", "2", "--jobs", "2")


def swept(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[dict[str, Any], str]:
    capsys.readouterr()
    assert sweep([*words, "--json"]) == 0
    printed = capsys.readouterr()
    return json.loads(printed.out), printed.err


def test_there_is_a_task_for_every_combination_and_seed() -> None:
    words = ("--seeds", "2", "--first-seed", "5", "--controller", "fbql", "--controller", "uniform")
    found = tasks_of(study, *words, "--set", "dt_s=0.01,0.02", "--set", "ball_robot_friction=0.1", "--set", "dt_s=0.03")
    played = [
        (each.parameters["seed"], each.parameters["match"]["controller"], tuple(each.parameters["match"]["set"]))
        for each in found
    ]
    settings = [(f"dt_s={dt}", "ball_robot_friction=0.1") for dt in ("0.01", "0.02", "0.03")]
    assert played == [(seed, name, setting) for seed in (5, 6) for name in ("fbql", "uniform") for setting in settings]
    assert len({each.key for each in found}) == len(found)
    assert all(json.loads(json.dumps(each.parameters)) == each.parameters for each in found)


def test_controllers_of_one_name_from_two_files_are_two_combinations_wherever_they_are_played(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("first", "second"):
        (tmp_path / name).mkdir()
        bandit(tmp_path / name)
    with only_ours():
        words = ("--seeds", "1", "--guided", "0", "--episodes", "1", "--max-steps", "2")
        files = [f"{name}/bandit.py:Bandit" for name in ("first", "second")]
        found = tasks_of(study, *words, *[word for file in files for word in ("--controller", file)])
        monkeypatch.chdir("/")
        rows = study.table({each.key: study.run(each.parameters) for each in found})
    assert [(row["runs"], row["label"]) for row in rows] == [
        (1, f"Bandit, controller_file {tmp_path / file}") for file in files
    ]


def test_a_value_that_is_a_list_is_one_value() -> None:
    found = tasks_of(study, "--seeds", "1", "--controller", "uniform", "--set", "behaviors=ball_seeking,approaching")
    assert [each.parameters["match"]["set"] for each in found] == [["behaviors=ball_seeking,approaching"]]


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--seeds", "0"], "--seeds is 0"),
        (["--set", "nothing=1"], "no parameter 'nothing'"),
        (["--set", "dt_s=0.01,soon"], "'soon' is not a number"),
        (["--set", "dt_s=0.01,"], "'' is not a number"),
        (["--set", "seed=1"], "--set seed: use --seeds and --first-seed instead"),
        (["--set", "controller=fbql,uniform"], "--set controller: use --controller "),
        (["--controller", "nobody"], "nobody"),
        (["--set", f"dt_s={','.join(['0.01'] * 3)}", "--seeds", "-1"], "--seeds is -1"),
    ],
)
def test_bad_input_is_refused_before_anything_is_played(words: list[str], says: str) -> None:
    with pytest.raises(BadInput, match=says):
        tasks_of(study, *words)


def test_each_match_is_that_of_train_and_the_row_has_all_of_them(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    result, said = swept(
        capsys, *QUICK, "--seeds", "2", "--set", "ball_robot_friction=0.1,0.3", "--out", str(tmp_path / "out")
    )
    assert [row["label"] for row in result["table"]] == [
        f"subsumption, ball_robot_friction {value}" for value in ("0.1", "0.3")
    ]
    assert "4 tasks, 2 at a time; results go to" in said.splitlines()[0]
    tasks = {path.name: json.loads(path.read_text()) for path in (tmp_path / "out" / "tasks").glob("*.json")}
    assert len(tasks) == 4
    episodes = steps = goals = 0
    for seed in (0, 1):
        capsys.readouterr()
        words = [
            "--controller",
            "subsumption",
            "--episodes",
            "2",
            "--seed",
            str(seed),
            "--set",
            "ball_robot_friction=0.3",
        ]
        assert train([*words, "--json", "--out", str(tmp_path / f"train{seed}")]) == 0
        summary = json.loads(capsys.readouterr().out)
        task = tasks[f"2-subsumption-ball_robot_friction=0.3-s{seed}.json"]
        assert task["digest"] == summary["digest"]
        episodes, steps, goals = episodes + summary["episodes"], steps + summary["steps"], goals + summary["goals"]
    row = result["table"][1]
    assert (row["runs"], row["success_rate"], row["cost_per_goal"]) == (2, goals / episodes, steps / goals)
    assert row["cost_per_goal_low"] <= row["cost_per_goal"] <= row["cost_per_goal_high"]
    assert result["table"][0]["cost_ratio"] is None
    assert row["cost_ratio"] == pytest.approx(row["cost_per_goal"] / result["table"][0]["cost_per_goal"])
    assert (tmp_path / "out" / "sweep.svg").read_bytes().startswith(b"<?xml")
    assert "| combination |" in (tmp_path / "out" / "tables.md").read_text()


def test_guided_episodes_are_not_counted() -> None:
    (task,) = tasks_of(
        study, "--seeds", "1", "--policy", "none", "--guided", "2", "--episodes", "1", "--max-steps", "300"
    )
    counts = study.run(task.parameters)["counts"]
    assert counts["episodes"] == 1
    assert counts["steps"] <= 300


def test_it_is_extended_with_more_seeds(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    words = (*QUICK, "--out", str(tmp_path / "out"))
    few, _ = swept(capsys, *words, "--seeds", "1")
    more, said = swept(capsys, *words, "--seeds", "2")
    assert "1 of 2 tasks are already done" in said
    assert [few["table"][0]["runs"], more["table"][0]["runs"]] == [1, 2]


def test_an_option_without_effect_is_reported_once(capsys: pytest.CaptureFixture[str]) -> None:
    tasks_of(study, "--seeds", "3", "--controller", "subsumption", "--set", "fbql_hold_s=0.02,0.1")
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 1
    assert "fbql_hold_s" in said[0]
