"""Lesson 5: the ratio and what it means, compared with the statistics over the same runs."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import fbql
import pytest
from fbql.course.comparison import LEARNED, RULE, check
from fbql.statistics.inference import paired_p_value
from fbql_common.core.errors import BadInput

SEEDS = range(101, 107)
MATCH: dict[str, Any] = {"episodes": 2, "max_steps": 1500}


def play_rule(place: Path, seed: int, **more: Any) -> None:
    fbql.play("subsumption", preset="paper", seed=seed, out=place / f"{RULE}-{seed}", **{**MATCH, **more})


def play_learned(place: Path, seed: int, **more: Any) -> None:
    fbql.play("fbql", seed=seed, out=place / f"{LEARNED}-{seed}", **{"learn": False, **MATCH, **more})


@pytest.fixture(scope="module")
def work(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The shipped policy against badly chosen thresholds, so that few episodes tell them apart. Not to be changed."""
    place = tmp_path_factory.mktemp("work")
    for seed in SEEDS:
        play_rule(place, seed)
        play_learned(place, seed)
    return place


@pytest.fixture
def copied(work: Path, tmp_path: Path) -> Path:
    """The same, to be changed."""
    return Path(shutil.copytree(work, tmp_path / "work"))


def statistics_of(work: Path) -> tuple[float, float]:
    """Ratio of steps per goal, and p."""
    runs = {
        name: [json.loads((work / f"{name}-{seed}" / "summary.json").read_text()) for seed in SEEDS]
        for name in (RULE, LEARNED)
    }
    costs = {name: sum(run["steps"] for run in own) / sum(run["goals"] for run in own) for name, own in runs.items()}
    each = [[run["steps"] / max(run["goals"], 1) for run in runs[name]] for name in (LEARNED, RULE)]
    return costs[LEARNED] / costs[RULE], paired_p_value(*each)


def test_the_ratio_and_what_it_means_are_right(work: Path) -> None:
    ratio, p = statistics_of(work)
    assert ratio < 0.9 and p < 0.05, "runs that tell them apart"
    verdict = check([f"{ratio:.3g}", "learned"], work)
    assert verdict.right
    assert f"p = {p:.2g} over 6 seeds (learned)" in verdict.line
    assert verdict.line.count(" to ") == 2, "with intervals"


def test_another_meaning_is_wrong_and_p_is_said(work: Path) -> None:
    ratio, p = statistics_of(work)
    for word in ("rule", "undecided"):
        verdict = check([f"{ratio:.3g}", word], work)
        assert not verdict.right
        assert f"p = {p:.2g}; 0.05 or more means" in verdict.line


def test_the_rule_can_win_too(copied: Path, tmp_path: Path) -> None:
    for seed in SEEDS:
        for name, other in ((RULE, "x"), (LEARNED, RULE), ("x", LEARNED)):
            (copied / f"{name}-{seed}").rename(copied / f"{other}-{seed}")
    ratio, _ = statistics_of(copied)
    assert not check([f"{ratio:.3g}", "rule"], copied).right, (
        "Subsumption learns nothing, but its runs may go on learning"
    )
    for seed in SEEDS:
        config = copied / f"{LEARNED}-{seed}" / "config.yaml"
        config.write_text(config.read_text().replace("learn: true", "learn: false"))
    verdict = check([f"{ratio:.3g}", "rule"], copied)
    assert verdict.right, verdict.line


def test_equal_players_are_undecided(copied: Path) -> None:
    for seed in SEEDS:
        shutil.rmtree(copied / f"{RULE}-{seed}")
        fbql.play("fbql", learn=False, seed=seed, out=copied / f"{RULE}-{seed}", **MATCH)
    verdict = check(["1", "undecided"], copied)
    assert verdict.right and "p = 1 over 6 seeds (undecided)" in verdict.line
    assert not check(["1", "learned"], copied).right


def test_another_ratio_is_wrong_and_the_inverse_is_recognised(work: Path) -> None:
    ratio, _ = statistics_of(work)
    verdict = check([f"{ratio + 0.1:.3g}", "learned"], work)
    assert not verdict.right and "compare.py prints it" in verdict.line
    verdict = check([f"{1 / ratio:.4g}", "learned"], work)
    assert not verdict.right and "that is rule over learned" in verdict.line


def test_too_few_seeds_can_tell_nothing(copied: Path) -> None:
    shutil.rmtree(copied / f"{RULE}-101")
    verdict = check(["0.5", "learned"], copied)
    assert not verdict.right and "share 5 seeds" in verdict.line


def test_runs_that_go_on_learning_are_no_comparison(copied: Path) -> None:
    for seed in SEEDS:
        shutil.rmtree(copied / f"{LEARNED}-{seed}")
        play_learned(copied, seed, learn=True, episodes=1)
    verdict = check(["0.5", "learned"], copied)
    assert not verdict.right and "play them frozen, with --no-learn" in verdict.line


def test_runs_of_different_lengths_are_no_comparison(copied: Path) -> None:
    for seed in SEEDS:
        shutil.rmtree(copied / f"{LEARNED}-{seed}")
        play_learned(copied, seed, episodes=1)
    verdict = check(["0.5", "learned"], copied)
    assert not verdict.right and "played differently" in verdict.line


def test_a_run_that_differs_in_more_than_the_seed_is_named(copied: Path) -> None:
    play_rule(copied, 107, max_steps=500)
    with pytest.raises(BadInput, match=r"rule-107: differs from rule-101 in more than the seed"):
        check(["0.5", "learned"], copied)
