"""How well a tree plays: beside the instructor and the shipped tree, from the same starts, and what to demonstrate more."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from commands import induce
from fbql.demonstrations.make_tree import instructed, patterns_for, request_of
from fbql.demonstrations.practice import PracticeGround, measure, measuring_seeds
from fbql.demonstrations.skill import INSTRUCTOR, SEED, SHIPPED, TREE, skill_of
from fbql_behaviors.core.exercises import EXERCISES, mean_cost
from fbql_behaviors.core.tree import Leaf, Tree
from fbql_behaviors.shipped import shipped_trees
from fbql_behaviors.storage import load_tree

STARTS = 12


def shipped(behavior: str) -> Tree:
    return load_tree(shipped_trees() / f"{behavior}.json")


def patterns_of_few(behavior: str, demonstrations: int = 4) -> Any:
    request = request_of(behavior)
    few = replace(request, recipe=replace(request.recipe, demonstrations=demonstrations))
    return patterns_for(few, instructed(few))


@pytest.mark.parametrize("behavior", EXERCISES)
def test_every_driver_has_the_same_starts_and_the_measure_of_tune(behavior: str) -> None:
    tree = shipped(behavior)
    found = skill_of(tree, patterns_of_few(behavior), STARTS)
    assert found is not None
    assert [each.driver for each in found.skills] == [TREE, INSTRUCTOR, SHIPPED]
    mine, instructor, ships = found.skills
    assert replace(mine, driver="") == replace(ships, driver="")
    attempts = measure(tree, EXERCISES[behavior], PracticeGround(behavior), measuring_seeds(SEED, STARTS))
    assert mine.cost.estimate == mean_cost(attempts, EXERCISES[behavior])
    assert instructor.cost.estimate != mine.cost.estimate
    assert mine.cost.low <= mine.cost.estimate <= mine.cost.high


def test_a_tree_that_stands_still_never_arrives_and_the_instructor_does() -> None:
    tree = shipped("ball_seeking")
    stands = replace(tree, nodes=(0,), leaves=(Leaf(0.0, 0.0, 1),))
    found = skill_of(stands, patterns_of_few("ball_seeking"), STARTS)
    assert found is not None
    assert found.skills[0].arrived == 0.0
    assert found.skills[0].cost.estimate == EXERCISES["ball_seeking"].max_steps
    assert found.skills[1].arrived == 1.0


def test_few_demonstrations_leave_gaps_that_more_of_them_close() -> None:
    tree = shipped("ball_seeking")
    few, many = (skill_of(tree, patterns_of_few("ball_seeking", count), STARTS) for count in (1, 60))
    assert few is not None and many is not None
    assert few.coverage.gaps()
    assert (few.coverage.share_shown or 0.0) < (many.coverage.share_shown or 0.0)


def test_a_behavior_without_an_exercise_has_no_skill() -> None:
    tree = replace(shipped("ball_seeking"), behavior="of_mine")
    assert skill_of(tree, patterns_of_few("ball_seeking"), STARTS) is None


def test_induce_tells_the_skill_and_draws_what_to_show_more_of(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    words = ["ball_seeking", "--patterns", "40", "--starts", f"{STARTS}", "--out", str(tmp_path / "tree.json")]
    assert induce([*words, "--report"]) == 0
    said = capsys.readouterr().out
    assert f"skill, from the same {STARTS} starts: steps to the ball (95 % interval)" in said
    for driver in (TREE, INSTRUCTOR, SHIPPED):
        assert f"    {driver}" in said
    assert "demonstrate more of this, where it drove but nothing was demonstrated:" in said
    grid = [line.strip() for line in said.splitlines() if set(line.strip()) <= set("#?.") and len(line.strip()) == 8]
    assert len(grid) == 8
    page = (tmp_path / "tree.html").read_text()
    assert "<h2>Skill</h2>" in page
    assert ">?</text>" in page
    assert induce([*words, "--json"]) == 0
    skill = json.loads(capsys.readouterr().out)["skill"]
    assert [each["driver"] for each in skill["drivers"]] == [TREE, INSTRUCTOR, SHIPPED]
    assert skill["show_more_of"][0]["where"] in said


def test_it_is_not_measured_where_that_is_not_wanted(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    words = ["ball_seeking", "--patterns", "40", "--json", "--out", str(tmp_path / "tree.json")]
    assert induce([*words, "--starts", "0"]) == 0
    assert "skill" not in json.loads(capsys.readouterr().out)
    assert induce([*words, "--starts", "-1"]) == 2
