"""Every command reports each option that has no effect on what it was asked to do in one line, and no other option."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest
from commands import bringup, compare, demonstrate, induce, replay, train, tree
from places import ROOT
from recorded_match import record_match

OWN = str(ROOT / "examples/shooting/shooting.py")
TREE = str(ROOT / "examples/shooting/shooting.json")
NOT_OWN = f"--observation has no effect: {OWN}:shooting is for behavior 'shooting', which has no tree here"
WITHOUT_RECOMPUTING = "--observation has no effect without --verify or --trees: no behavior is recomputed"
SHIPPED = str(ROOT / "ros2_ws/src/fbql_behaviors/fbql_behaviors/trees")
VERIFIED = "with --verify: nothing is published"
CHANGED = "with a change such as --set: nothing is published"
SHORT = ("--episodes", "1", "--max-steps", "3")

CASES: Sequence[tuple[Callable[[Sequence[str]], int], str, list[str]]] = [
    (replay, "{run} --rate 0 --wait 0 --observation {own}", [WITHOUT_RECOMPUTING]),
    (replay, "{run} --rate 0 --wait 0", []),
    (replay, "{run} --verify --rate 1 --start 0 --wait 1 --duration 2 --loop --domain 7",
     [f"--{name} has no effect {VERIFIED}" for name in ("rate", "start", "duration", "loop", "domain", "wait")]),
    (replay, "{run} --verify --observation {own}", [NOT_OWN]),
    (replay, "{run} --verify", []),
    (replay, "{run} --preset paper --no-clock --topics world",
     [f"--{name} has no effect {CHANGED}" for name in ("topics", "no-clock")]),
    (replay, "{run} --preset paper --observation {own}", [WITHOUT_RECOMPUTING]),
    (replay, "{run} --trees {shipped} --observation {own}", [NOT_OWN]),
    (compare, "{run} {other} --force", ["--force has no effect without --figure: nothing is written"]),
    (compare, "{run} {other}", []),
    (demonstrate, "ball_seeking --demonstrations 1 --steps 9 --out {new} --ascii --realtime 1 --observation {own}",
     [NOT_OWN, *(f"--{name} has no effect without --keyboard or --replay" for name in ("realtime", "ascii"))]),
    (demonstrate, "--replay {demos} --out {new} --ascii --realtime 2 --observation {own}",
     [NOT_OWN, "--out has no effect with --replay: nothing is written",
      *(f"--{name} has no effect without a terminal: nothing is shown" for name in ("realtime", "ascii"))]),
    (demonstrate, "--merge {demos} --out {new} --realtime 2",
     ["--realtime has no effect without --keyboard or --replay"]),
    (demonstrate, "--replay {demos}", []),
    (induce, "ball_seeking --demos {demos} --out {new} --method dp --seed 1 --epsilon-start 0.5 --observation {own}",
     [NOT_OWN, *(f"--{name} has no effect with --method dp" for name in ("epsilon-start", "seed"))]),
    (induce, "ball_seeking --demos {demos} --out {new} --method rl --seed 1 --epsilon-start 0.5", []),
    (tree, "check {shipped}/approaching.json --observation {own}", [NOT_OWN]),
    (tree, "explain {shipped}/approaching.json --observation {own}", [NOT_OWN]),
    (tree, "export {shipped}/approaching.json --to dot --observation {own}", [NOT_OWN]),
    (tree, "check {tree} --observation {own}", []),
    (train, "--controller subsumption --policy none --no-learn --observation {own} --set fbql_rate=0.1 --out {new}",
     ["--no-learn has no effect: subsumption does not learn",
      "fbql_rate has no effect: it belongs to fbql and fbql_model, and the controller is subsumption",
      "--policy none has no effect: subsumption takes no policy",
      NOT_OWN]),
    (train, "--controller subsumption --set ball_mass_kg=0.05 --preset paper --out {new}", []),
]  # fmt: skip


@pytest.fixture(scope="module")
def places(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Two runs and a recording of demonstrations, all short."""
    root = tmp_path_factory.mktemp("no_effect")
    run = record_match(root / "run", seed=1, max_steps=9, episodes=1)
    shutil.copytree(run, root / "other")
    demos = root / "demos"
    assert demonstrate(["ball_seeking", "--demonstrations", "2", "--steps", "60", "--out", str(demos)]) == 0
    places = {"run": run, "other": root / "other", "demos": demos, "own": OWN, "tree": TREE, "shipped": SHIPPED}
    return {name: str(place) for name, place in places.items()}


@pytest.mark.parametrize(("command", "words", "lines"), CASES, ids=[words for _, words, _ in CASES])
def test_an_option_without_effect_is_reported_in_a_line(
    command: Callable[[Sequence[str]], int],
    words: str,
    lines: list[str],
    places: dict[str, str],
    tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
) -> None:
    given = [word.format(**places, new=tmp_path / "new") for word in words.split()]
    code = command([*given, *(SHORT if command is train else ())])
    said = capfd.readouterr().err
    assert code == 0, said
    assert [line.partition(": ")[2] for line in said.splitlines() if "has no effect" in line] == lines


def test_bringup_reports_as_train_does(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "environ", dict(os.environ))
    words = ["--controller", "subsumption", "--no-learn", "--policy", "none", "--observation", OWN]
    assert bringup([*words, "--set", "tie_rule=first", "--out", str(tmp_path)]) == 2, "refused when all is said"
    said = [line.partition(": ")[2] for line in capfd.readouterr().err.splitlines() if "has no effect" in line]
    assert said == [
        "--no-learn has no effect: subsumption does not learn",
        "tie_rule has no effect: it belongs to fbql_literal, and the controller is subsumption",
        "--policy none has no effect: subsumption takes no policy",
        NOT_OWN,
    ]
