"""The lessons: their texts in `docs/course`, their checks, and where the student's work is."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from importlib import import_module
from pathlib import Path

from fbql_common.checkout import source_tree
from fbql_common.core.errors import BadInput

from fbql.cli.places import RUNS
from fbql.course.verdict import Verdict

WORK = RUNS / "course"
"""Where the commands of the lessons write."""
CHECKS = {1: "goal", 2: "driving", 3: "leaf", 4: "ties", 5: "comparison", 6: "own_code"}
"""Number of a lesson -> the module here that checks its task."""


def text_of(number: int | None) -> str:
    """The text of a lesson; without a number, that of the course. Raises BadInput."""
    root = source_tree()
    if root is None:
        raise BadInput("the texts of the lessons are in docs/course of a clone of the project; --check works here too")
    pattern = "README.md" if number is None else f"{_known(number)}_*.md"
    found = sorted((root / "docs" / "course").glob(pattern))
    if not found:
        raise BadInput(
            f"{root / 'docs' / 'course'}: {pattern} is not there; get it again with git checkout docs/course"
        )
    return found[0].read_text(encoding="utf-8")


def check(number: int, answer: Sequence[object] = (), work: Path | str | None = None) -> Verdict:
    """Checks the task of a lesson.

    Args:
        answer: the words of the answer.
        work: the directory that the lesson's commands wrote to; WORK unless given.

    Raises:
        BadInput: an unknown lesson, an answer of another form, or files that can't be used.
    """
    module = import_module(f"fbql.course.{CHECKS[_known(number)]}")
    checker: Callable[[Sequence[str], Path], Verdict] = module.check
    return checker([str(word) for word in answer], Path(work or WORK))


def _known(number: int) -> int:
    if number not in CHECKS:
        raise BadInput(f"there is no lesson {number}; choose one from {min(CHECKS)} to {max(CHECKS)}")
    return number
