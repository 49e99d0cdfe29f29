"""Errors in one line: how long they may be, and where in a user's file they come from."""

from __future__ import annotations

import pytest
from fbql_common.core.errors import BadInput, in_one_line


def raised(source: str, file: str) -> BaseException:
    try:
        exec(compile(source, file, "exec"), {})
    except Exception as error:
        return error
    raise AssertionError("nothing was raised")


def test_an_error_names_the_innermost_line_of_the_users_file() -> None:
    error = raised("def inner():\n    raise ValueError('no\\n  such   thing')\n\ninner()\n", "own.py")
    assert in_one_line(error, "own.py") == "ValueError in line 2: no such thing"
    assert in_one_line(error, "other.py") == "ValueError: no such thing"
    assert in_one_line(error) == "ValueError: no such thing"


def test_a_syntax_error_names_its_own_line() -> None:
    error = raised("x = 1\ny = = 2\n", "own.py")
    assert in_one_line(error, "own.py") == "SyntaxError in line 2: invalid syntax"


@pytest.mark.parametrize(("length", "shown"), [(5000, 5000), (5001, 5000)])
def test_a_very_long_message_is_cut_and_says_how_long_it_was(length: int, shown: int) -> None:
    cut = f" ... ({length} characters)" if shown < length else ""
    assert str(BadInput("x" * length)) == "x" * shown + cut


def test_a_message_is_one_line_whatever_it_quotes() -> None:
    assert "\n" not in str(BadInput("a\nb"))
