"""Lesson 3: the leaf that answers, and the tree in which it alone was changed."""

from __future__ import annotations

import shutil
from math import radians
from pathlib import Path

import pytest
from commands import tree as command
from fbql.course.leaf import AT, CHANGED, TREE, check
from fbql_behaviors.shipped import shipped_trees
from fbql_behaviors.storage import load_tree
from fbql_common.core.errors import BadInput


@pytest.fixture
def work(tmp_path: Path) -> Path:
    (tmp_path / TREE).parent.mkdir()
    shutil.copy(shipped_trees() / "ball_seeking.json", tmp_path / TREE)
    return tmp_path


def leaf_there(work: Path) -> int:
    metres, degrees = map(float, AT.split(","))
    return load_tree(work / TREE).answer((metres, radians(degrees)))[0]


def change(work: Path, leaf: int, wheels: str, source: str = TREE) -> None:
    words = ["change", str(work / source), "--leaf", str(leaf), "--command", wheels, "--out", str(work / CHANGED)]
    assert command(words) == 0


def test_the_leaf_that_answers_alone_made_to_turn_left_is_right(work: Path) -> None:
    leaf = leaf_there(work)
    change(work, leaf, "-20,20")
    verdict = check([str(leaf)], work)
    assert verdict.right
    assert verdict.line.startswith(f"leaf {leaf} now means: turning left on the spot; your tree reaches the ball from ")
    assert verdict.line.count("of 20 starts") == 2


def test_another_leaf_is_wrong_and_the_hint_says_where_that_one_answers(work: Path) -> None:
    leaf = leaf_there(work)
    change(work, leaf, "-20,20")
    verdict = check([str(leaf - 1)], work)
    assert not verdict.right
    assert verdict.line.startswith(f"leaf {leaf - 1} answers where: ball ")
    assert f"tree.py explain {work / TREE} --at 1,30" in verdict.line
    assert check(["101"], work).line.startswith("there is no leaf 101, the last one is 100")


@pytest.mark.parametrize(
    ("wheels", "motion"),
    [("20,20", "forwards"), ("20,-20", "turning right on the spot"), ("10,40", "forwards, turning left")],
)
def test_another_motion_is_wrong_and_is_named(work: Path, wheels: str, motion: str) -> None:
    leaf = leaf_there(work)
    change(work, leaf, wheels)
    verdict = check([str(leaf)], work)
    assert not verdict.right
    assert f"leaf {leaf} means: {motion}; it should mean: turning left on the spot" in verdict.line


def test_a_second_changed_leaf_is_wrong_and_is_named(work: Path) -> None:
    leaf = leaf_there(work)
    change(work, leaf + 1, "1,1")
    change(work, leaf, "-20,20", CHANGED)
    verdict = check([str(leaf)], work)
    assert not verdict.right
    assert f"only leaf {leaf} should change, but {leaf + 1} changed too;" in verdict.line


def test_a_tree_with_other_regions_is_wrong(work: Path) -> None:
    (work / CHANGED).parent.mkdir()
    shutil.copy(shipped_trees() / "wall_avoiding.json", work / CHANGED)
    verdict = check([str(leaf_there(work))], work)
    assert not verdict.right and "has other regions" in verdict.line


def test_the_tree_of_another_behavior_is_refused(work: Path) -> None:
    shutil.copy(shipped_trees() / "wall_avoiding.json", work / TREE)
    with pytest.raises(BadInput, match="a tree of wall_avoiding, not of ball_seeking"):
        check(["1"], work)


def test_a_change_that_is_not_made_yet_is_asked_for(work: Path) -> None:
    with pytest.raises(BadInput, match=r"changed/ball_seeking\.json: not there yet"):
        check([str(leaf_there(work))], work)
