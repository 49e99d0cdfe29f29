"""The paper's protocol: its tasks, and that its table says rung a, ties and courses."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from fbql_common.core.errors import BadInput
from fbql_studies.common.methods import FBQL, FBQL_MODEL, LEARNERS, RETUNED, greedy, guided, imagined_once, papers_guide
from fbql_studies.paper import study as paper
from studies import make_imagination_short, make_short, shipped, tasks_of

SMALL = ("--trees", "1", "--seeds", "1", "--max-steps", "120")


def test_the_papers_protocol_tells_rung_a_ties_and_courses(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    make_short(monkeypatch)
    monkeypatch.setattr(paper, "behaviors_of", lambda _seed: shipped())
    monkeypatch.setattr(paper, "MOST_EPISODES", 2)
    monkeypatch.setattr(paper, "GUIDED_EPISODES", 2)
    make_imagination_short(monkeypatch)
    found = tasks_of(paper, *SMALL, "--seeds", "2", "--goals", "1", "--evaluate", "2")
    results = {task.key: paper.run({**task.parameters, "max_steps": 400}) for task in found}
    assert json.loads(json.dumps(results, allow_nan=False)) == results
    rows = paper.table(results)
    json.dumps(rows, allow_nan=False)
    when = {each: [row for row in rows if row.get("when") == each] for each in ("while learning", "frozen")}
    for told in when.values():
        assert [row["method"] for row in told] == list(paper.METHODS)
    assert {row["episodes"] for row in when["frozen"]} == {4}
    methods = {row["method"]: row for row in when["while learning"]}
    assert len({tuple(row) for row in rows if "method" in row}) == 1
    assert methods["fbql literal, ties: none"]["tied_share"] > 0.9
    guides = ("", ", paper's guide")
    learners = (*LEARNERS, greedy(FBQL), FBQL_MODEL)
    assert {row["rung"] for row in rows if "rung" in row} == {
        f"a, {name}" for each in learners for name in (each, papers_guide(each))
    }
    for told in when.values():
        model = next(row for row in told if row["method"] == FBQL_MODEL)
        for control in ("retuned", "guided", "imagined", "guided_data", "learner"):
            assert model[f"ratio_{control}"] is not None or model[f"p_{control}"] is not None, control
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
    for part in ("others", "imagining"):
        played = [(task["tree_seed"], seed) for task in others if task["part"] == part for seed in task["run_seeds"]]
        assert sorted(played) == [(tree, seed) for tree in (1001, 1002, 1003) for seed in range(1000, 1009)]


def test_twins_of_the_model_play_what_was_imagined_before_the_first_free_episode_or_nothing() -> None:
    model, once = paper.METHODS[FBQL_MODEL], paper.METHODS[imagined_once(FBQL_MODEL)]
    assert (model.learn, once.learn) == (True, False)
    assert once.fbql_model_first_episodes == model.fbql_model_first_episodes > 0
    assert paper.METHODS["fbql_model, only guided data"].fbql_model_data == "guided"
    assert {each.preset for each in paper.IMAGINING.values()} == {"tuned", "paper"}
    for method in (imagined_once(FBQL_MODEL), guided(greedy(FBQL)), guided(FBQL), guided(papers_guide(FBQL))):
        assert method in paper.STOPPED
    assert not paper.STOPPED & {"fbql, never learned", "fbql literal, frozen twin", FBQL_MODEL}


def test_frozen_play_is_by_the_largest_weight_where_learning_is_drawn() -> None:
    drawn, deployed = paper.METHODS[FBQL], paper.as_deployed(paper.METHODS[FBQL])
    assert (drawn.fbql_play, deployed.fbql_play) == ("drawn", "held")
    assert deployed.fbql_play_s < drawn.fbql_play_s
    literal = paper.METHODS["fbql literal, ties: first"]
    assert paper.as_deployed(literal) == literal


def test_other_tree_sets_and_run_seeds_can_be_asked_for_and_those_of_tuning_are_refused() -> None:
    found = tasks_of(paper, "--trees", "2", "--seeds", "4", "--first-trees", "1021", "--first-seed", "2000")
    assert {task.parameters["tree_seed"] for task in found} == {1021, 1022}
    assert {seed for task in found for seed in task.parameters["run_seeds"]} == {2000, 2001, 2002, 2003}
    for option, number in (("--first-trees", "1000"), ("--first-seed", "999"), ("--first-seed", "90001")):
        with pytest.raises(BadInput, match=f"{option} is {number}; it must be 1"):
            tasks_of(paper, option, number)


@pytest.mark.parametrize("option", ["--trees", "--seeds", "--goals", "--evaluate", "--max-steps"])
def test_the_papers_protocol_refuses_numbers_below_1_and_beyond_reason(option: str) -> None:
    for number in ("0", "99999999"):
        with pytest.raises(BadInput, match=f"{option} is {number}; it must be 1 to "):
            tasks_of(paper, *SMALL, option, number)
