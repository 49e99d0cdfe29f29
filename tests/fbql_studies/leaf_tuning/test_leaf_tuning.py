"""The study of leaf tuning: what its tasks are, that they repeat, and that its table says what was counted."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import pytest
from fbql.statistics.tables import as_markdown
from fbql_behaviors.core.exercises import EXERCISES
from fbql_behaviors.core.leaf_tuning import TuningParameters
from fbql_behaviors.core.tree import Tree
from fbql_common.core.errors import BadInput
from fbql_fusion.core.tasks.soccer.subsumption import PRESETS, Thresholds
from fbql_studies.common.play import Score
from fbql_studies.leaf_tuning import study as leaf_tuning
from fbql_studies.runner.study import Result
from studies import tasks_of


def test_every_kind_of_trees_is_tuned_with_every_seed() -> None:
    found = tasks_of(leaf_tuning, "--seeds", "3")
    assert len({task.key for task in found}) == len(found) == 9
    assert {task.parameters["trees"] for task in found} == {
        leaf_tuning.SHIPPED,
        leaf_tuning.PRINTED,
        leaf_tuning.FRESH,
    }
    json.dumps([task.parameters for task in found])


def test_what_is_measured_on_was_never_tuned_on() -> None:
    tuning = {task.parameters["tuning_seed"] for task in tasks_of(leaf_tuning, "--seeds", "50")}
    assert max(tuning) < 1000 <= leaf_tuning.FIRST_MEASURING_SEED


def test_fresh_trees_are_others_for_each_seed() -> None:
    fresh = [
        task.parameters
        for task in tasks_of(leaf_tuning, "--seeds", "4")
        if task.parameters["trees"] == leaf_tuning.FRESH
    ]
    assert len({each["demonstration_seed"] for each in fresh}) == 4
    assert min(each["demonstration_seed"] for each in fresh) >= 1000


def test_numbers_out_of_range_are_refused() -> None:
    with pytest.raises(BadInput, match="--starts is 0"):
        tasks_of(leaf_tuning, "--starts", "0")


def few(behavior: str) -> TuningParameters:
    """Tuning that takes no time."""
    return TuningParameters(episodes=2 if behavior == "wall_avoiding" else 20, epsilon_start=1.0, min_updates=1)


def no_play(trees: Mapping[str, Tree], thresholds: Thresholds, seed: int, episodes: int) -> Score:
    """Instead of play: tuned trees are counted as goals."""
    tuned = sum(tree.origin["method"] == "leaf_tuning" for tree in trees.values())
    return Score(episodes, tuned + 1, 1, 0, 1000 + seed, 2, 3)


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    recipes = {name: replace(recipe, demonstrations=30) for name, recipe in leaf_tuning.RECIPES.items()}
    monkeypatch.setattr(leaf_tuning, "RECIPES", recipes)
    monkeypatch.setattr(leaf_tuning, "tuning_of", few)
    monkeypatch.setattr(leaf_tuning, "score", no_play)
    monkeypatch.setattr(leaf_tuning, "retuned", lambda _: Thresholds(0.1, 0.2))


@pytest.mark.usefixtures("small")
def test_a_task_tunes_every_behavior_and_plays_teams_with_all_one_or_none_tuned() -> None:
    task = tasks_of(leaf_tuning, "--seeds", "1", "--starts", "2", "--episodes", "10")[0]
    result = leaf_tuning.run(task.parameters)
    assert json.loads(json.dumps(result)) == result
    assert leaf_tuning.run(task.parameters) == result
    assert set(result["behaviors"]) == set(EXERCISES)
    for name, found in result["behaviors"].items():
        assert 0 < found["leaves_changed"] <= found["leaves"]
        assert EXERCISES[name].measure in found["before"]
        assert set(found["before"]) == set(found["after"])
    teams = {(team["preset"], team["tuned"]): team["goals"] - 1 for team in result["teams"]}
    assert len(teams) == len(result["teams"])
    for preset in PRESETS:
        tuned = {"none": 0, "all": 3, "ball_seeking": 1, "wall_avoiding": 1, "approaching": 1}
        assert {who: count for (which, who), count in teams.items() if which == preset} == tuned
    assert {who: count for (which, who), count in teams.items() if which == "re-tuned"} == {"none": 0, "all": 3}
    assert {team["steps"] for team in result["teams"]} == {1000 + 10_000 + task.parameters["tuning_seed"]}


def result(before: float, goals: int) -> Result:
    """A task's result with one behavior that gets 10 better, and one team that scores in place of 10 goals."""

    def team(tuned: str, goals: int) -> dict[str, Any]:
        counts = Score(100, goals, 4, 2, 100_000, 50, 70)._asdict()
        return {"tuned": tuned, "preset": "tuned", "thresholds": [0.07, 0.1], **counts}

    figures = {name: {"steps": before if name == "ball_seeking" else 1.0} for name in EXERCISES}
    after = {name: {"steps": value["steps"] - 10.0} for name, value in figures.items()}
    return {
        "trees": leaf_tuning.SHIPPED,
        "behaviors": {name: {"before": figures[name], "after": after[name]} for name in EXERCISES},
        "teams": [team("none", 10), team("all", goals)],
    }


def test_the_table_pairs_before_and_after_of_the_same_seed() -> None:
    rows = leaf_tuning.table({str(k): result(100.0 + 50.0 * k, 20) for k in range(8)})
    ball = next(row for row in rows if row["tuned"] == "ball_seeking")
    assert (ball["n"], ball["before"], ball["after"]) == (8, 275.0, 265.0)
    # Every pair differs by the same, however much the seeds differ.
    assert (ball["difference"], ball["low"], ball["high"]) == (-10.0, -10.0, -10.0)
    assert ball["percent"] == pytest.approx(-1000 / 275)
    assert ball["p"] < 0.02


def test_the_table_counts_teams_against_the_untuned_one() -> None:
    rows = {row["measure"]: row for row in leaf_tuning.table({"a": result(100.0, 20)}) if row["tuned"] == "all"}
    told = {name: (row["before"], row["after"]) for name, row in rows.items()}
    assert told == {
        "success rate": (0.1, 0.2),
        "cost per goal": (10_000.0, 5_000.0),
        "own goals per 100 episodes": (4.0, 4.0),
        "timeouts per 100 episodes": (2.0, 2.0),
        "collisions begun per episode": (0.5, 0.5),
        "contact steps per episode": (0.7, 0.7),
    }


def test_one_seed_alone_has_no_interval_and_no_p() -> None:
    rows = leaf_tuning.table({"a": result(100.0, 20)})
    assert all(row["low"] is row["high"] is row["p"] is None for row in rows)
    assert not any("(" in cell for told in leaf_tuning.words(rows).values() for line in told.body for cell in line)


def test_a_table_of_nothing_is_empty() -> None:
    assert leaf_tuning.table({}) == []


def test_the_tables_for_the_page_tell_of_behaviors_and_teams_before_and_after() -> None:
    told = leaf_tuning.words(leaf_tuning.table({"a": result(100.0, 20), "b": result(120.0, 20)}))
    text = "\n".join(map(as_markdown, told.values()))
    assert "| shipped | ball seeking | steps | 110 | 100 | -9.1 | -10 (-10 to -10) | " in text
    assert "| shipped | tuned | success rate | 0.1 | 0.2 | +100.0 | +0.1 (+0.1 to +0.1) | " in text
