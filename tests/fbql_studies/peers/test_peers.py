"""The study of peers: which seeds train and which judge, what its table says, and what it says without the extra."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from fbql_common.core.errors import BadInput
from fbql_studies.common.methods import FBQL, LAW, PAPER, RETUNED
from fbql_studies.common.play import Score
from fbql_studies.common.training import FIRST_RUN_SEED, FIRST_TREE_SEED
from fbql_studies.common.tuning import TUNING_SEED
from fbql_studies.ladder import study as ladder
from fbql_studies.peers import fair_ppo, ppo_settings
from fbql_studies.peers import study as peers
from fbql_studies.runner.study import MEASURED, Result
from places import ROOT
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
    found = tasks_of(peers, "--trees", "3", "--seeds", "2", "--settings", "4")
    tuning = 4 * len(peers.CRITICS) * len(peers.TUNING_TREES)
    assert len({task.key for task in found}) == len(found) == tuning + 3 + 3 * 2 * len(LEARNERS)
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
    judging = {peers.evaluation_seed_of(peers.SEEDS, *pair) for pair in pairs}
    assert len(training) == len(judging) == len(pairs)
    assert max(training) < FIRST_RUN_SEED <= min(judging)


def test_settings_are_tuned_on_tree_sets_and_seeds_that_neither_train_nor_judge_the_peers() -> None:
    sets = range(len(peers.TUNING_TREES))
    trained = {peers.FIRST_TUNING_SEED + k for k in sets}
    played = {peers.FIRST_CHOOSING_SEED + k for k in sets}
    assert not trained & played
    assert TUNING_SEED not in trained | played
    assert max(trained | played) < peers.training_seed_of(0, 0)
    assert max(peers.TUNING_TREES) < FIRST_TREE_SEED <= peers.SEEDS.first_tree


def test_the_peers_are_judged_on_tree_sets_and_episodes_that_are_not_the_ladders() -> None:
    pairs = [(k, seed) for k in range(peers.MOST_TREE_SETS) for seed in range(peers.SEEDS_OF_A_TREE_SET)]
    judging = {peers.evaluation_seed_of(peers.SEEDS, *pair) for pair in pairs}
    assert not judging & {ladder.SEEDS.judging(*pair) for pair in pairs}
    trees = {peers.SEEDS.tree(k) for k in range(peers.MOST_TREE_SETS)}
    assert not trees & {ladder.SEEDS.tree(k) for k in range(peers.MOST_TREE_SETS)}


@pytest.mark.parametrize(
    "arguments",
    [
        ("--seeds", "0"),
        ("--seeds", "101"),
        ("--trees", "10"),
        ("--steps", "0"),
        ("--settings", "0"),
        ("--first-seed", "999"),
    ],
)
def test_numbers_out_of_range_are_refused(arguments: tuple[str, str]) -> None:
    with pytest.raises(BadInput, match=f"{arguments[0]} is {arguments[1]}"):
        tasks_of(peers, *arguments)


def controls(steps: dict[str, int], goals: int = 9) -> Result:
    """The result of a task that played so many steps with each method, with two seeds."""
    return {
        "runs": [
            peers._run_row(method, 1601, seed, Score(10, goals, 1, 9 - goals, count + seed, 3, 30), 0)
            for method, count in steps.items()
            for seed in range(2)
        ]
    }


def learner(method: str, seed: int, steps: int) -> Result:
    row: dict[str, Any] = peers._run_row(method, 1601, seed, Score(10, 10, 0, 0, steps, 5, 50), 1000)
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


def tried(setting: int, critic: str, steps: int, goals: int = 10) -> Result:
    score = Score(10, goals, 0, 10 - goals, steps, 0, 0)
    own = {"setting": setting, "critic": critic, "training_steps": 1000, **score._asdict()}
    return {"tried": own, MEASURED: {"training_s": 60.0}}


@pytest.mark.parametrize("installed", [True], indirect=True)
@pytest.mark.usefixtures("installed")
def test_settings_are_ranked_for_each_critic_by_their_cost_on_all_tuning_trees(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ppo_settings, "TUNED_INFORMED", 2)
    results = {
        "a": tried(1, "sensed", 900),
        "b": tried(1, "sensed", 700),
        "c": tried(0, "sensed", 6000),
        "d": tried(3, "sensed", 40_000, goals=0),
        "e": tried(2, "informed", 500),
    }
    rows = peers.table(results)
    json.dumps(rows, allow_nan=False)
    assert set().union(*rows) <= set(peers.COLUMNS)
    found = [(row["critic"], row["setting"], row["cost_per_goal"], row["runs"], row["chosen"]) for row in rows]
    assert found == [
        ("sensed", 1, 80.0, 2, False),
        ("sensed", 0, 600.0, 1, True),
        ("sensed", 3, None, 1, False),
        ("informed", 2, 50.0, 1, True),
    ]
    text = peers.words(rows)["settings of PPO, on training seeds"]
    assert [line[:2] for line in text.body] == [
        ["sensed", "1"], ["sensed", "0, chosen"], ["sensed", "3"], ["informed", "2, chosen"]
    ]  # fmt: skip


@pytest.mark.parametrize("installed", [True], indirect=True)
@pytest.mark.usefixtures("installed")
def test_each_part_of_fbql_is_compared_with_the_method_before_it_and_with_fbql() -> None:
    first, second = [*fair_ppo.STEPS][:2]
    results = {
        f"{method}{seed}": learner(method, seed, steps)
        for method, steps in {first: 8000, second: 4000, FBQL: 2000}.items()
        for seed in range(2)
    }
    rows = {row["method"]: row for row in peers.table(results)}
    assert rows[first]["ratio_before"] is None
    assert rows[second]["ratio_before"] == pytest.approx(0.5)
    assert rows[first]["ratio_fbql"] == pytest.approx(4.0)
    text = peers.words([*rows.values()])["PPO with what fbql has"]
    assert [line[0] for line in text.body] == [first, second]
    assert text.body[0][text.head.index("to the row before")] == ""
    assert text.body[1][text.head.index("to the row before")].startswith("0.50")


def test_a_tuned_method_is_trained_again_when_another_setting_is_chosen(monkeypatch: pytest.MonkeyPatch) -> None:
    keys = {method: peers._key_of(method) for method in fair_ppo.STEPS}
    monkeypatch.setattr(ppo_settings, "TUNED_INFORMED", 7)
    changed = {method for method in fair_ppo.STEPS if peers._key_of(method) != keys[method]}
    assert changed == {fair_ppo.TUNED_PPO}


def test_the_tuned_settings_are_the_best_of_the_published_table() -> None:
    rows = [row for row in json.loads((ROOT / "docs/data/peers.json").read_text())["table"] if "setting" in row]
    if not rows:
        pytest.skip("the settings have not been measured yet")
    for critic, informed in peers.CRITICS.items():
        best = next(row for row in rows if row["critic"] == critic)
        assert best["setting"] == fair_ppo.tuned(informed)
