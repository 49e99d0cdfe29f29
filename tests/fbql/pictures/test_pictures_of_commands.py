"""Commands that make numbers make a picture of them."""

from __future__ import annotations

import json
from pathlib import Path
from xml.etree import ElementTree

import pytest
from commands import train, tune

pytest.importorskip("matplotlib", reason="it is in requirements/study.txt")


def is_svg(path: Path) -> bool:
    return ElementTree.parse(path).getroot().tag.endswith("svg")


def test_train_draws_its_course_from_goal_to_goal(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["--controller", "subsumption", "--goals", "6", "--seed", "2", "--json", "--out", str(tmp_path / "run")]
    assert train([*words, "--figures"]) == 0
    summary = json.loads(capsys.readouterr().out)
    figures = tmp_path / "run" / "figures"
    assert {path.stem for path in figures.glob("*.svg")} == {
        f"success_{name}" for name in ("steps", "collisions", "failures", "rate")
    }
    assert all(map(is_svg, figures.glob("*.svg")))
    assert len((figures / "successes.csv").read_text().splitlines()) == 1 + summary["goals"]


def test_tune_draws_every_start_before_and_after(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    figure = tmp_path / "of" / "tuning.svg"
    words = ["wall_avoiding", "--episodes", "2", "--starts", "6", "--json", "--out", str(tmp_path / "tree.json")]
    assert tune([*words, "--figure", str(figure)]) == 0
    assert is_svg(figure)
    assert "6 starts" in figure.read_text()
    assert json.loads(capsys.readouterr().out)["starts"] == 6
