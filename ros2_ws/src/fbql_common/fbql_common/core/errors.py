"""The one exception for bad input: what is wrong, where, and what to do, in one line."""

from __future__ import annotations

from traceback import extract_tb

from fbql_common.core.text import one_line

_MOST = 5000
"""Longest message [characters]; a path has up to 4096 bytes."""


class BadInput(ValueError):
    """A request that cannot be carried out as given.

    The message is one line for a person: what is wrong, where, what to do. Programs print it and
    exit with code 2. What it quotes of a file, an argument or a name is escaped, and shortened if it is very long.
    """

    def __init__(self, text: object) -> None:
        line = one_line(text)
        super().__init__(line if len(line) <= _MOST else f"{line[:_MOST]} ... ({len(line)} characters)")


def in_one_line(error: BaseException, file: str = "") -> str:
    """An error of a user's code in one line, with the last line of that file in the traceback, if there is one."""
    if isinstance(error, SyntaxError):
        return f"{type(error).__name__} in line {error.lineno}: {error.msg}"
    lines = [frame.lineno for frame in extract_tb(error.__traceback__) if frame.filename == file]
    place = f" in line {lines[-1]}" if lines else ""
    return f"{type(error).__name__}{place}: {' '.join(str(error).split())}"
