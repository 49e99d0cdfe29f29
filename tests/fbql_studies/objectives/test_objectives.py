"""The study of objectives: its tasks, that they repeat, and that its table pairs what was counted."""

from __future__ import annotations

import json
from typing import Any

import pytest
from fbql.statistics.tables import as_markdown
from fbql_common.core.errors import BadInput
from fbql_studies.common import pattern_sets
from fbql_studies.common.play import Score
from fbql_studies.common.team_play import SETTINGS
from fbql_studies.common.tuning import TUNING_SEED
from fbql_studies.leaf_tuning.study import FIRST_MEASURING_SEED
from fbql_studies.objectives import study as objectives
from fbql_studies.trees.methods import FIRST_SEED
from studies import FEW_DEMONSTRATIONS, tasks_of


def test_no_seed_is_one_of_another_study_or_of_tuning() -> None:
    seeds = {task.parameters["seed"] for task in tasks_of(objectives, "--seeds", "500")}
    assert len(seeds) == 500
    assert max(TUNING_SEED, FIRST_SEED + 500) < min(seeds)
    assert max(seeds) < FIRST_MEASURING_SEED


@pytest.mark.parametrize("name", ["seeds", "episodes"])
def test_a_study_of_nothing_is_refused(name: str) -> None:
    with pytest.raises(BadInput, match=f"--{name} is 0"):
        tasks_of(objectives, f"--{name}", "0")


def test_both_objectives_play_the_same_episodes_twice_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pattern_sets, "RECIPES", FEW_DEMONSTRATIONS)
    monkeypatch.setattr(objectives, "retuned", lambda _: (0.1, 0.2))
    asked: list[tuple[int, int]] = []

    def count_leaves(found: Any, _thresholds: object, seed: int, episodes: int) -> Score:
        asked.append((seed, episodes))
        return Score(episodes, 2, 0, 1, sum(tree.leaf_count for tree in found.values()), 3, 4)

    monkeypatch.setattr(objectives, "score", count_leaves)
    (task,) = tasks_of(objectives, "--seeds", "1", "--episodes", "3")
    result = objectives.run(task.parameters)
    assert objectives.run(task.parameters) == json.loads(json.dumps(result)) == result
    assert set(asked) == {(objectives.FIRST_SEED, 3)}
    assert set(result) == {"weighted", "printed"}
    assert result["weighted"]["play"]["fixed"]["steps"] != result["printed"]["play"]["fixed"]["steps"]
    rows = objectives.table({"a": result})
    assert all(row["low"] is row["high"] is row["p"] is None for row in rows), "one seed alone has no interval and no p"
    (told,) = objectives.words(rows).values()
    assert not any("(" in cell for line in told.body for cell in line)
    assert "| held out | ball seeking: error [levels] | " in as_markdown(told)


def result(weighted_steps: int, printed_steps: int) -> dict[str, Any]:
    def of(steps: int) -> dict[str, Any]:
        score = Score(100, 50, 10, 40, steps, 7, 9)._asdict()
        return {
            "rmse_levels": dict.fromkeys(objectives.RECIPES, steps / 1000),
            "play": dict.fromkeys(SETTINGS, score),
        }

    return {"weighted": of(weighted_steps), "printed": of(printed_steps)}


def test_the_table_pairs_the_two_objectives_of_a_seed() -> None:
    rows = objectives.table({str(k): result(1000 + 500 * k, 1100 + 500 * k) for k in range(8)})
    assert {row["n"] for row in rows} == {8}
    cost = next(row for row in rows if (row["where"], row["measure"]) == ("paper", "cost per goal"))
    assert (cost["weighted"], cost["printed"]) == (55.0, 57.0)
    assert (cost["difference"], cost["low"], cost["high"]) == (2.0, 2.0, 2.0)
    assert cost["p"] < 0.02
    same = next(row for row in rows if (row["where"], row["measure"]) == ("fixed", "success rate"))
    assert (same["weighted"], same["printed"], same["difference"], same["p"]) == (0.5, 0.5, 0.0, 1.0)
    assert objectives.table({}) == []
