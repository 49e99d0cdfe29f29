"""Text of others is shown, and never acted on."""

from __future__ import annotations

import pytest
from fbql_common.core.errors import BadInput
from fbql_common.core.text import as_lines, encodable, one_line, quoted

FORGED = "x\nall is well\r\x1b[2J\x1b]0;title\x07\u202etxt\u2066\u200b\ud800\x00\x7f\x9b\u2028"


def test_printable_text_stays_as_it_is():
    for text in ("", "/runs/a b", "grün 球", "\\n", "a·b – 100 %"):
        assert one_line(text) == text


def test_what_a_terminal_acts_on_is_escaped():
    shown = one_line(FORGED)
    assert shown.isprintable()
    assert shown == r"x\nall is well\r\x1b[2J\x1b]0;title\x07\u202etxt\u2066\u200b\ud800\x00\x7f\x9b\u2028"


def test_of_several_lines_each_stays_one():
    assert as_lines(["a\nb", "c", 1]) == "a\\nb\nc\n1"


def test_a_number_with_more_digits_than_python_prints_is_told_by_its_type():
    assert quoted(10**4000) == "1" + "0" * 4000
    assert quoted(10**5000) == "a int with too many digits"
    assert quoted([10**5000]) == "a list with too many digits"
    assert quoted("a") == "'a'"


def test_bad_input_is_one_printable_line_of_bounded_length():
    assert str(BadInput(f"{FORGED}: no such file")).isprintable()
    assert str(BadInput(BadInput("a\nb"))) == "a\\nb"
    assert str(BadInput("x" * 5000)) == "x" * 5000
    assert str(BadInput("x" * 5001)) == f"{'x' * 5000} ... (5001 characters)"


@pytest.mark.parametrize("text", [FORGED, FORGED.encode("utf-8", "replace").decode()])
def test_an_escaped_text_can_be_encoded(text):
    one_line(text).encode()


@pytest.mark.parametrize(
    ("encoding", "shown"), [("ascii", r"gr\xfcn"), ("utf-8", "grün"), (None, "grün"), ("", "grün")]
)
def test_what_an_encoding_lacks_is_escaped_and_an_unknown_one_is_utf_8(encoding: str | None, shown: str) -> None:
    assert encodable("grün", encoding) == shown
