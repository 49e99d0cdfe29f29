"""Lesson 6: controllers and behaviors of students, which really play."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from fbql.course import own_code
from fbql.course.own_code import check
from fbql_common.core.errors import BadInput
from own_controller import only_ours
from places import ROOT

BEGINNING = ROOT / "docs" / "course" / "my_controller.py"
LINE = "        driver = 0  # ball_seeking, always. Be smarter!\n"
RULE = """
        wall_m, wall_rad = outputs[1].observation
        way_rad, approach_rad = outputs[2].observation
        driver = 1 if wall_m < 0.07 else 2 if abs(approach_rad) > 0.1 else 0
"""
LEARNER = """
    kind = "counting"
    steps = 0

    def learn(self, transition):
        self.steps += 1

    def to_arrays(self):
        import numpy as np

        return {"steps": np.array([self.steps])}

    def load_arrays(self, arrays):
        self.steps = int(arrays["steps"][0])
"""
BEHAVIOR = """
from fbql_behaviors.core.observation import Feature, Observation
from fbql_common.core.geometry import ball_distance_and_bearing


def sense(world):
    return (ball_distance_and_bearing(world)[1],)


def turn(observation):
    return INSTRUCTOR


NAME = Observation((Feature("ball_bearing", "rad", LOW, HIGH),), sense, turn)
"""


@pytest.fixture(autouse=True)
def short(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Shorter matches, and no test leaves a controller behind."""
    monkeypatch.setattr(own_code, "MATCH", {"episodes": 4, "max_steps": 800, "seed": 6})
    monkeypatch.setattr(own_code, "LESSONS", {"episodes": 1, "guided": 1, "max_steps": 100, "seed": 5})
    monkeypatch.setattr(own_code, "PATTERNS", 100)
    with only_ours():
        yield


def controller(place: Path, line: str, more: str = "") -> str:
    """The beginning of the lesson, with another line in the place of the one to be changed."""
    text = BEGINNING.read_text()
    assert LINE in text
    file = place / "my_controller.py"
    file.write_text(text.replace(LINE, line) + more)
    return str(file)


def behavior(place: Path, name: str, instructor: str, low: float = -3.14, high: float = 3.14) -> str:
    file = place / "my_behavior.py"
    text = BEHAVIOR.replace("INSTRUCTOR", instructor).replace("NAME", name)
    file.write_text(text.replace("LOW", str(low)).replace("HIGH", str(high)))
    return str(file)


def test_the_beginning_as_it_is_is_not_enough(tmp_path: Path) -> None:
    verdict = check([controller(tmp_path, LINE)], tmp_path)
    assert not verdict.right
    assert "equal weights scored" in verdict.line and "score more than they do" in verdict.line


def test_a_rule_that_scores_more_than_equal_weights_is_right(tmp_path: Path) -> None:
    verdict = check([controller(tmp_path, RULE) + ":MyController"], tmp_path)
    assert verdict.right, verdict.line
    assert "the same seed gives the same match" in verdict.line


def test_a_learner_learns_first_and_plays_frozen(tmp_path: Path) -> None:
    frozen = LEARNER + "\n    def begin_episode(self, phase):\n        assert self.steps or int(phase) < 2\n"
    verdict = check([controller(tmp_path, RULE, frozen)], tmp_path)
    assert verdict.right, verdict.line


def test_chance_that_does_not_come_from_the_generator_is_wrong(tmp_path: Path) -> None:
    source = controller(tmp_path, "        import random\n\n        driver = random.randrange(3)\n")
    verdict = check([source], tmp_path)
    assert not verdict.right
    assert "the same seed gave two different matches: the controller must depend on its arguments" in verdict.line


def test_a_mistake_in_the_code_is_refused_with_its_line(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="controller 'MyController': ZeroDivisionError in line 20"):
        check([controller(tmp_path, "        driver = 1 // 0\n")], tmp_path)


def test_a_file_with_neither_is_refused(tmp_path: Path) -> None:
    (tmp_path / "nothing.py").write_text("x = 1\n")
    with pytest.raises(BadInput, match="it has no class with a method 'select'"):
        check([str(tmp_path / "nothing.py")], tmp_path)


def test_a_behavior_with_a_tree_that_drives_is_right(tmp_path: Path) -> None:
    source = behavior(tmp_path, "turning", "(-20.0, 20.0) if observation[0] > 0 else (20.0, -20.0)", -1.5, 1.5)
    verdict = check([source], tmp_path)
    assert verdict.right, verdict.line
    assert verdict.line.startswith("the tree of turning has ")


def test_a_behavior_that_always_does_the_same_is_wrong(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("fbql_behaviors.core.instructors.Hand.command", lambda _self, _observed: (20.0, 20.0))
    verdict = check([behavior(tmp_path, "steady", "(20.0, 20.0)")], tmp_path)
    assert not verdict.right
    assert "the tree of steady is a single leaf" in verdict.line


def test_a_behavior_that_never_drives_is_wrong(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(own_code, "LEAST_SHARE", 0.5)
    source = behavior(tmp_path, "narrow", "(60.0, 40.0) if observation[0] > 0 else (40.0, 60.0)", -0.1, 0.1)
    verdict = check([source], tmp_path)
    assert not verdict.right
    assert "narrow drove in" in verdict.line and "widen them" in verdict.line


def test_a_behavior_of_the_project_and_one_that_nobody_shows_are_refused(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="'approaching' is a behavior of the project"):
        check([behavior(tmp_path, "approaching", "(1.0, 1.0)")], tmp_path)
    source = behavior(tmp_path, "shy", "(1.0, 1.0)")
    Path(source).write_text(Path(source).read_text().replace(", sense, turn)", ", sense)"))
    with pytest.raises(BadInput, match="'shy' has no instructor"):
        check([source], tmp_path)
