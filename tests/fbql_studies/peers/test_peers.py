"""The study of peers: which seeds train and which judge, what its table says, and what it says without the extra."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from fbql_common.core.errors import BadInput
from fbql_studies.common.methods import LAW, PAPER, RETUNED
from fbql_studies.common.play import Score
from fbql_studies.common.training import FIRST_RUN_SEED
from fbql_studies.peers import study as peers
from fbql_studies.runner.study import MEASURED, Result
from studies import shipped, tasks_of

pytest.importorskip("gymnasium", reason="an optional extra, which is in requirements/test.txt")

from fbql_studies.peers.learners import LEARNERS, NEED_PPO, TABULAR


@pytest.fixture
def installed(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Says that the extra is installed, or that it is not."""
    missing = () if request.param else (peers.EXTRA,)
    monkeypatch.setattr(peers, "find_spec", lambda name: None if name in missing else object())


@pytest.mark.parametrize("installed", [True], indirect=True)
@pytest.mark.usefixtures("installed")
def test_every_learner_has_a_task_for_each_tree_set_and_seed_and_the_controls_one_for_each_tree_set() -> None:
    found = tasks_of(peers, "--trees", "3", "--seeds", "2")
    assert len({task.key for task in found}) == len(found) == 3 + 3 * 2 * len(LEARNERS)
    assert all("/" not in task.key and " " not in task.key for task in found)
    assert json.loads(json.dumps([task.parameters for task in found])) == [task.parameters for task in found]


@pytest.mark.parametrize("installed", [False], indirect=True)
@pytest.mark.usefixtures("installed")
def test_without_the_extra_its_peers_are_left_out_with_one_line_and_rows_that_say_so(
    capsys: pytest.CaptureFixture[str],
) -> None:
    found = tasks_of(peers, "--trees", "1", "--seeds", "1")
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "pip install -r requirements/peers.txt" in said
    assert {task.parameters["part"] for task in found} == {peers.CONTROLS, *LEARNERS} - set(NEED_PPO)
    rows = peers.table({"a": controls({LAW: 500})})
    assert [row["method"] for row in rows] == [LAW, *NEED_PPO]
    assert all(set(row) == set(rows[0]) for row in rows)
    assert {row["note"] for row in rows[1:]} == {peers.NOT_INSTALLED}


def test_a_seed_either_trains_or_judges() -> None:
    pairs = [(k, seed) for k in range(peers.MOST_TREE_SETS) for seed in range(peers.SEEDS_OF_A_TREE_SET)]
    training = {peers.training_seed_of(*pair) for pair in pairs}
    judging = {peers.evaluation_seed_of(*pair) for pair in pairs}
    assert len(training) == len(judging) == len(pairs)
    assert max(training) < FIRST_RUN_SEED <= min(judging)


@pytest.mark.parametrize("arguments", [("--seeds", "0"), ("--seeds", "101"), ("--trees", "10"), ("--steps", "0")])
def test_numbers_out_of_range_are_refused(arguments: tuple[str, str]) -> None:
    with pytest.raises(BadInput, match=f"{arguments[0]} is {arguments[1]}"):
        tasks_of(peers, *arguments)


def controls(steps: dict[str, int], goals: int = 9) -> Result:
    """The result of a task that played so many steps with each method, with two seeds."""
    return {
        "runs": [
            peers._run_row(method, 0, seed, Score(10, goals, 1, 9 - goals, count + seed, 3, 30), 0)
            for method, count in steps.items()
            for seed in range(2)
        ]
    }


def learner(method: str, seed: int, steps: int) -> Result:
    row: dict[str, Any] = peers._run_row(method, 0, seed, Score(10, 10, 0, 0, steps, 5, 50), 1000)
    return {"runs": [row | {"played": "greedy", "curve": []}], MEASURED: {"training_s": 10.0 + seed}}


@pytest.mark.parametrize("installed", [True], indirect=True)
@pytest.mark.usefixtures("installed")
def test_the_table_pairs_every_method_with_subsumption_on_the_same_episodes() -> None:
    results = {"controls": controls({RETUNED: 9000, LAW: 4500})}
    results |= {f"t{seed}": learner(TABULAR, seed, 20_000) for seed in range(2)}
    with_paper = {**results, "paper": controls({PAPER: 18_000})}
    assert peers.table(with_paper)[0]["ratio_paper"] == pytest.approx(9001 / 36_001)
    rows = {row["method"]: row for row in peers.table(results)}
    assert list(rows) == [LAW, RETUNED, TABULAR]
    assert (rows[RETUNED]["ratio_retuned"], rows[RETUNED]["p_retuned"]) == (1.0, None)
    assert rows[RETUNED]["ratio_paper"] is None, "nobody played it"
    assert rows[LAW]["ratio_retuned"] == pytest.approx(9001 / 18_001)
    found = rows[TABULAR]
    assert (found["runs"], found["goals"], found["episodes"]) == (2, 20, 20)
    assert (found["success_rate"], found["cost_per_goal"]) == (1.0, 2000.0)
    assert found["ratio_retuned"] == pytest.approx(2000 / (18_001 / 18))
    assert (found["collisions_begun_per_goal"], found["collision_steps_per_goal"]) == (0.5, 5.0)
    assert (found["training_steps"], found["training_s"], found["note"]) == (1000.0, 10.5, "greedy")


@pytest.mark.parametrize("installed", [True], indirect=True)
@pytest.mark.usefixtures("installed")
def test_a_method_without_a_goal_has_no_cost_and_the_table_is_json() -> None:
    rows = peers.table({"controls": controls({RETUNED: 9000}), "more": controls({LAW: 40_000}, goals=0)})
    json.dumps(rows, allow_nan=False)
    none = next(row for row in rows if row["method"] == LAW)
    assert (none["goals"], none["cost_per_goal"], none["success_rate"]) == (0, None, 0.0)
    assert none["collisions_begun_per_goal"] is None


@pytest.mark.parametrize("installed", [True], indirect=True)
@pytest.mark.usefixtures("installed")
def test_a_task_gives_the_same_result_again_and_its_figures_can_be_drawn(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(peers, "behaviors_of", lambda _seed: shipped())
    monkeypatch.setattr("fbql_studies.peers.learners.CHOOSING_EPISODES", 1)
    task = next(
        each
        for each in tasks_of(peers, "--trees", "1", "--seeds", "1", "--steps", "2000", "--episodes", "2")
        if each.parameters["part"] == TABULAR
    )
    result = peers.run(task.parameters)
    assert json.loads(json.dumps(result)) == result
    assert {**peers.run(task.parameters), MEASURED: 0} == {**result, MEASURED: 0}
    row = result["runs"][0]
    assert (row["method"], row["episodes"]) == (TABULAR, 2)
    assert 0 < sum(part["steps"] for part in row["curve"]) <= row["training_steps"] + 4000
    pytest.importorskip("matplotlib", reason="it is in requirements/study.txt")
    files = peers.figures({"a": result}, tmp_path)
    assert [file.name for file in files] == ["curves.json", "fusion_peers.svg", "fusion_peers_training.svg"]
    assert all(file.read_text().startswith("<?xml") for file in files[1:])
