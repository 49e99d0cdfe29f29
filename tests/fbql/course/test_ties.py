"""Lesson 4: the share of tied joint states and whom the tie rule favors, in a policy that was really learned."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import fbql
import numpy as np
import pytest
from fbql.course.ties import EQUAL, FIRST, PRINTED, check
from fbql_common.core.errors import BadInput

MATCH: dict[str, Any] = {"episodes": 2, "max_steps": 500, "seed": 4}


@pytest.fixture(scope="module")
def work(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The three runs of the lesson, shorter. Not to be changed."""
    place = tmp_path_factory.mktemp("work")
    fbql.play("fbql_literal", guided=0, out=place / PRINTED, **MATCH)
    fbql.play("uniform", out=place / EQUAL, **MATCH)
    # Collisions are frequent in play at a wall, so that a few joint states are not tied.
    fbql.play("fbql_literal", guided=0, parameters={"tie_rule": "first"}, out=place / FIRST, **MATCH)
    return place


def answer_of(work: Path) -> tuple[float, str]:
    """As the lesson has it: by NumPy, from the file."""
    policy = np.load(work / FIRST / "policy.npz")
    q, weights = policy["array/q"], policy["array/weights"]
    return 100 * (q == q[:, :1]).all(axis=1).mean(), str(policy["behaviors"][weights.mean(axis=0).argmax()])


def test_the_measured_share_and_the_favorite_are_right(work: Path) -> None:
    tied, favorite = answer_of(work)
    assert 50.0 < tied < 100.0, "a run in which something can be measured"
    verdict = check([f"{tied:.1f}", favorite], work)
    assert verdict.right
    assert "have the same Q for every behavior" in verdict.line and f"and {favorite} has" in verdict.line
    assert check([f"{tied:.0f}%", favorite], work).right, "a sign does no harm"


def test_without_a_choice_the_printed_method_is_that_of_equal_weights(work: Path) -> None:
    """What the lesson says of the digests."""
    digests = {(work / name / "summary.json").read_text().partition('"digest": "')[2][:64] for name in (PRINTED, EQUAL)}
    assert len(digests) == 1


def test_another_share_is_wrong_and_a_likely_mistake_is_named(work: Path) -> None:
    tied, favorite = answer_of(work)
    for given, hint in (
        (tied - 1.0, "count the rows of q"),
        (100.0 - tied, "that is the share of the joint states that are not tied"),
        (tied / 100.0, "write it in percent"),
    ):
        verdict = check([f"{given:.3f}", favorite], work)
        assert not verdict.right
        assert hint in verdict.line


def test_another_behavior_is_wrong(work: Path) -> None:
    tied, favorite = answer_of(work)
    for other in {"ball_seeking", "wall_avoiding", "approaching", "goalkeeping"} - {favorite}:
        verdict = check([f"{tied:.1f}", other], work)
        assert not verdict.right
        assert f"{other} does not have the largest mean weight" in verdict.line


def test_two_matches_that_differ_are_wrong_and_it_is_said_how_to_play_them(work: Path, tmp_path: Path) -> None:
    place = Path(shutil.copytree(work, tmp_path / "work"))
    shutil.rmtree(place / EQUAL)
    fbql.play("uniform", out=place / EQUAL, **{**MATCH, "seed": 5})
    tied, favorite = answer_of(place)
    verdict = check([f"{tied:.1f}", favorite], place)
    assert not verdict.right
    assert "printed and equal have different digests" in verdict.line


def test_the_policy_of_another_controller_is_refused(work: Path, tmp_path: Path) -> None:
    place = Path(shutil.copytree(work, tmp_path / "work"))
    fbql.play("fbql_value", guided=0, out=tmp_path / "value", **MATCH)
    shutil.copy(tmp_path / "value" / "policy.npz", place / FIRST / "policy.npz")
    with pytest.raises(BadInput, match="a policy of fbql_value; play with --controller fbql_literal"):
        check(["50", "approaching"], place)
