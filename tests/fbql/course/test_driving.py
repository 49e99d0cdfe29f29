"""Lesson 2: demonstrations that can be driven again, and a tree of them that finds the ball, or does not."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from commands import demonstrate, induce
from fbql.course import driving
from fbql.course.driving import DEMONSTRATIONS, NEEDED, STARTS, TREE, attempts_of, check
from fbql.demonstrations.origins import about_origins, origins_of
from fbql.demonstrations.recording import save_demonstrations
from fbql_behaviors.core.patterns import Demonstration
from fbql_behaviors.demonstration_storage import load_recordings
from fbql_behaviors.shipped import shipped_trees
from fbql_behaviors.storage import load_tree
from fbql_common.core.errors import BadInput


def lesson_2(work: Path, count: int) -> Path:
    """What the commands of the lesson make, with so many demonstrations."""
    demonstrations = work / DEMONSTRATIONS
    words = ["ball_seeking", "--demonstrations", str(count), "--seed", "7", "--out", str(demonstrations)]
    assert demonstrate([*words, "--json"]) == 0
    assert induce(["ball_seeking", "--demos", str(demonstrations), "--out", str(work / TREE), "--json"]) == 0
    return work


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """As the lesson has it without a keyboard. Not to be changed."""
    return lesson_2(tmp_path_factory.mktemp("done"), 40)


def test_a_tree_that_finds_the_ball_is_right(done: Path) -> None:
    arrived = sum(attempt.arrived for attempt in attempts_of(load_tree(done / TREE)))
    assert arrived >= NEEDED
    verdict = check([], done)
    assert verdict.right
    assert f"reaches the ball from {arrived} of {STARTS} starts" in verdict.line
    assert verdict.line.startswith("40 demonstrations, driven again, are the same in every step")


def test_a_tree_of_few_demonstrations_is_not_enough_and_the_hint_says_what_to_show(tmp_path: Path) -> None:
    lesson_2(tmp_path, 3)
    arrived = sum(attempt.arrived for attempt in attempts_of(load_tree(tmp_path / TREE)))
    assert arrived < NEEDED
    verdict = check([], tmp_path)
    assert not verdict.right
    assert f"from {arrived} of {STARTS} starts, and at least {NEEDED} are needed" in verdict.line
    assert "demonstrate more of those" in verdict.line


def test_the_side_in_the_hint_is_where_the_ball_is_at_most_failed_starts(monkeypatch: pytest.MonkeyPatch) -> None:
    attempts = attempts_of(load_tree(shipped_trees() / "ball_seeking.json"))
    sides = iter(["to the left", "ahead", "ahead"])
    monkeypatch.setattr(driving, "_side", lambda _: next(sides))
    failed = [attempt._replace(arrived=k not in (1, 5, 9)) for k, attempt in enumerate(attempts)]
    assert driving._where_it_fails(failed) == "ahead"


@pytest.mark.parametrize(
    ("bearing", "side"),
    [(0, "ahead"), (44, "ahead"), (46, "to the left"), (-90, "to the right"), (140, "behind the robot")],
)
def test_a_direction_in_words(bearing: float, side: str) -> None:
    assert driving._side(bearing) == side


def test_a_tree_of_other_demonstrations_is_wrong(done: Path, tmp_path: Path) -> None:
    work = Path(shutil.copytree(done, tmp_path / "work"))
    shutil.copy(shipped_trees() / "ball_seeking.json", work / TREE)
    verdict = check([], work)
    assert not verdict.right
    assert (
        "was not made from these demonstrations; make it again: python3 scripts/induce.py ball_seeking" in verdict.line
    )


def test_demonstrations_that_nobody_drove_are_wrong(done: Path, tmp_path: Path) -> None:
    work = Path(shutil.copytree(done, tmp_path / "work"))
    (recording,) = load_recordings(work / DEMONSTRATIONS)
    first = recording.demonstrations[0]
    beamed = (*first.worlds[:-1], first.worlds[-1]._replace(robot_x_m=0.0))
    shutil.rmtree(work / DEMONSTRATIONS)
    origins = [replace(origin) for origin in origins_of(recording.about, "")]
    made = [Demonstration(beamed, first.commands), *recording.demonstrations[1:]]
    save_demonstrations(work / DEMONSTRATIONS, "ball_seeking", made, about_origins(origins))
    verdict = check([], work)
    assert not verdict.right
    assert verdict.line.startswith("your demonstrations, driven again, come out differently")


def test_a_match_in_the_place_of_the_demonstrations_is_refused(tmp_path: Path) -> None:
    from places import ROOT

    shutil.copytree(ROOT / "tests" / "data" / "recorded_match", tmp_path / DEMONSTRATIONS)
    with pytest.raises(BadInput, match="a match of fbql, not demonstrations"):
        check([], tmp_path)
