"""The result of a check, and helpers of all checks."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite
from pathlib import Path
from typing import NamedTuple

from fbql_common.core.errors import BadInput


class Verdict(NamedTuple):
    """Whether a task is done, in one line: what was found, or what is missing and where to look."""

    right: bool
    line: str


def words_of(answer: Sequence[str], form: str, example: str) -> Sequence[str]:
    """The words of an answer.

    Args:
        form: what is expected, one word for each word of the answer; empty for a task whose answer is a file.
        example: such an answer.

    Raises:
        BadInput: another number of words.
    """
    expected = form.split()
    if len(answer) == len(expected):
        return answer
    if not expected:
        raise BadInput(f"--check {' '.join(answer)}: this lesson looks at what you made; write --check alone")
    raise BadInput(f"--check takes {form} in this lesson, such as --check {example}")


def number_of(word: str, what: str) -> float:
    """The number in a word of an answer. Raises BadInput."""
    try:
        value = float(word.removesuffix("%"))
    except ValueError:
        raise BadInput(f"--check: {what} is '{word}', which is not a number") from None
    if not isfinite(value):
        raise BadInput(f"--check: {what} is '{word}'; it must be finite")
    return value


def leaf_of(word: str) -> int:
    """The leaf_id in a word of an answer. Raises BadInput."""
    if not word.isascii() or not word.isdecimal():
        raise BadInput(f"--check: the leaf is '{word}'; write its number, such as 12")
    return int(word[:9])


def made(path: Path) -> Path:
    """A path that the lesson's commands make. Raises BadInput where it is not there yet."""
    if not path.exists():
        raise BadInput(
            f"{path}: not there yet; a command of the lesson makes it (or name another place with --work DIR)"
        )
    return path
