"""The paper's protocol: its tasks, and that its table says rung a, ties and courses."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from fbql_common.core.errors import BadInput
from fbql_studies.common.methods import LEARNERS, RETUNED
from fbql_studies.paper import study as paper
from studies import make_short, shipped, tasks_of

SMALL = ("--trees", "1", "--seeds", "1", "--max-steps", "120")


def test_the_papers_protocol_tells_rung_a_ties_and_courses(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    make_short(monkeypatch)
    monkeypatch.setattr(paper, "behaviors_of", lambda _seed: shipped())
    monkeypatch.setattr(paper, "MOST_EPISODES", 2)
    monkeypatch.setattr(paper, "GUIDED_EPISODES", 2)
    found = tasks_of(paper, *SMALL, "--seeds", "2", "--goals", "1")
    results = {task.key: paper.run({**task.parameters, "max_steps": 400}) for task in found}
    assert json.loads(json.dumps(results, allow_nan=False)) == results
    rows = paper.table(results)
    json.dumps(rows, allow_nan=False)
    methods = {row["method"]: row for row in rows if "method" in row}
    assert list(methods) == list(paper.METHODS)
    assert len({tuple(row) for row in methods.values()}) == 1
    assert methods["fbql literal, ties: none"]["tied_share"] > 0.9
    guides = ("", ", paper's guide")
    assert {row["rung"] for row in rows if "rung" in row} == {f"a, {each}{by}" for each in LEARNERS for by in guides}
    for learner in LEARNERS:
        assert methods[learner]["tied_share"] is None
        for by in guides:
            assert None not in (methods[f"{learner}{by}"]["p_guided"], methods[f"{learner}{by}"]["p_untrained"])
            assert any(f"'{learner}{by}, only guided'" in row.get("measure", "") for row in rows)
    for run in (run for result in results.values() for run in result["runs"]):
        assert len(run["course"]) == run["episodes"]
        assert sum(steps for _, steps, _, _ in run["course"]) == run["steps"]
    pytest.importorskip("matplotlib", reason="it is in requirements/study.txt")
    assert [file.name for file in paper.figures(results, tmp_path)] == ["curves.json", "fusion_paper.svg"]


def test_each_tree_set_of_the_papers_protocol_is_tuned_for_in_one_task_and_no_run_is_played_twice() -> None:
    found = tasks_of(paper, "--trees", "3", "--seeds", "9")
    tuned = [task.parameters for task in found if task.parameters["part"] == RETUNED]
    assert [task["tree_seed"] for task in tuned] == [1001, 1002, 1003]
    assert all(task["run_seeds"] == list(range(1000, 1009)) for task in tuned)
    others = [task.parameters for task in found if task.parameters["part"] != RETUNED]
    played = [(task["tree_seed"], seed) for task in others for seed in task["run_seeds"]]
    assert sorted(played) == [(tree, seed) for tree in (1001, 1002, 1003) for seed in range(1000, 1009)]


@pytest.mark.parametrize("option", ["--trees", "--seeds", "--goals", "--max-steps"])
def test_the_papers_protocol_refuses_numbers_below_1_and_beyond_reason(option: str) -> None:
    for number in ("0", "99999999"):
        with pytest.raises(BadInput, match=f"{option} is {number}; it must be 1 to "):
            tasks_of(paper, *SMALL, option, number)
