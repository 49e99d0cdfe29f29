"""The course: every lesson has a text that fits it and a check, and the command shows one and reports the other."""

from __future__ import annotations

import importlib
import json
import re
from pathlib import Path

import pytest
from commands import lesson
from fbql.course import lessons
from fbql.course.lessons import CHECKS, check, text_of
from fbql.course.verdict import Verdict
from fbql_common.core.errors import BadInput
from places import ROOT

COURSE = ROOT / "docs" / "course"
MOST_WORDS = 900


@pytest.mark.parametrize("number", CHECKS)
def test_a_lesson_is_short_says_how_it_is_checked_and_what_comes_next(number: int) -> None:
    text = text_of(number)
    assert text.startswith(f"# Lesson {number}: ")
    assert len(text.split()) <= MOST_WORDS
    assert f"python3 scripts/lesson.py {number} --check" in text
    (file,) = COURSE.glob(f"{number}_*.md")
    assert f"({file.name})" in text_of(None), "the contents lead to it"
    if number < max(CHECKS):
        (following,) = COURSE.glob(f"{number + 1}_*.md")
        assert text.rstrip().splitlines()[-1].startswith(f"Next: [lesson {number + 1}]({following.name})")


@pytest.mark.parametrize("number", CHECKS)
def test_every_output_of_a_lesson_is_below_the_place_that_the_check_looks_at(number: int) -> None:
    outputs = re.findall(r"--out (\S+)", text_of(number))
    assert all(output.startswith("runs/course/") for output in outputs)


@pytest.mark.parametrize("number", CHECKS)
def test_what_a_check_looks_at_is_what_the_commands_of_the_lesson_write(number: int) -> None:
    module = importlib.import_module(f"fbql.course.{CHECKS[number]}")
    made = {"RUN", "DEMONSTRATIONS", "TREE", "CHANGED", "PRINTED", "EQUAL", "FIRST", "RULE", "LEARNED"} & set(
        vars(module)
    )
    assert made or number == 6
    written = " ".join(re.findall(r"--out runs/course/(\S+)", text_of(number)))
    assert not [name for name in made if getattr(module, name) not in written]


def test_the_command_shows_the_contents_and_each_lesson(capsys: pytest.CaptureFixture[str]) -> None:
    assert lesson([]) == 0
    assert capsys.readouterr().out.rstrip() == (COURSE / "README.md").read_text().rstrip()
    assert lesson(["3"]) == 0
    text = (COURSE / "3_read_a_tree.md").read_text().rstrip()
    assert capsys.readouterr().out.rstrip() == text
    assert lesson(["3", "--json", "--work", "elsewhere"]) == 0
    said = capsys.readouterr()
    assert json.loads(said.out) == {"lesson": 3, "text": text}
    assert said.err == "lesson.py: --work has no effect without --check\n"


def test_without_the_sources_the_command_says_where_the_texts_are(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(lessons, "source_tree", lambda: None)
    assert lesson(["1"]) == 2
    assert "docs/course of a clone" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["7"], "there is no lesson 7; choose one from 1 to 6"),
        (["0", "--check", "x"], "there is no lesson 0"),
        (["--check", "x"], "which lesson?"),
        (["one"], "invalid int value: 'one'"),
        (["1", "--check"], "--check takes BEHAVIOR LEAF in this lesson, such as --check ball_seeking 12"),
        (["4", "--check", "90"], "--check takes PERCENT BEHAVIOR"),
        (["4", "--check", "ninety", "approaching"], "the percentage is 'ninety', which is not a number"),
        (["4", "--check", "nan", "approaching"], "it must be finite"),
        (["5", "--check", "0.5", "perhaps"], "choose rule, learned or undecided"),
        (["3", "--check", "\u0663"], "the leaf is '\u0663'; write its number"),
        (["2", "--check", "12"], "write --check alone"),
    ],
)
def test_what_is_no_answer_is_refused_in_one_line(
    words: list[str], reason: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert lesson([*words, *(["--work", str(tmp_path)] if "--check" in words else [])]) == 2
    said = capsys.readouterr()
    assert (said.out, said.err.count("\n")) == ("", 1)
    assert reason in said.err


@pytest.mark.parametrize("number", sorted(set(CHECKS) - {6}))
def test_what_is_not_made_yet_is_named(number: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    answers = {1: ["ball_seeking", "1"], 3: ["1"], 4: ["50", "approaching"], 5: ["1", "undecided"]}
    assert lesson([str(number), "--work", str(tmp_path / "work"), "--check", *answers.get(number, [])]) == 2
    said = capsys.readouterr()
    assert said.err.count("\n") == 1
    assert f"{tmp_path / 'work'}" in said.err and "not there yet" in said.err


def test_a_right_answer_ends_with_0_and_a_wrong_one_with_1(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    found = Verdict(True, "so it is")
    monkeypatch.setattr("fbql.commands.lesson.check", lambda *_: found)
    assert lesson(["3", "--check", "1"]) == 0
    said = capsys.readouterr()
    assert (said.out, said.err) == ("Right: so it is.\n", "Next: python3 scripts/lesson.py 4\n")
    found = Verdict(False, "look there")
    assert lesson(["3", "--check", "1"]) == 1
    said = capsys.readouterr()
    assert (said.out, said.err) == ("", "lesson.py: not yet: look there\n")
    assert lesson(["3", "--check", "1", "--json"]) == 1
    assert json.loads(capsys.readouterr().out) == {"lesson": 3, "right": False, "line": "look there"}


def test_a_check_from_python_takes_numbers_and_paths(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="not there yet"):
        check(4, [98.5, "ball_seeking"], tmp_path)
    with pytest.raises(BadInput, match="no such file"):
        check(6, [tmp_path / "absent.py"])
