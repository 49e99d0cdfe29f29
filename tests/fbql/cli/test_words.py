"""Counts and shares in words."""

import pytest
from fbql.cli.words import counted, percent, share_text


@pytest.mark.parametrize(
    ("part", "whole", "words"),
    [
        (3, 4, "75 %"),
        (199, 200, "99.5 %"),
        (2, 3, "66.7 %"),
        (2499, 2500, "99.9 %"),  # not 100: one was missed
        (1, 2500, "0.1 %"),
        (0, 7, "0 %"),
        (7, 7, "100 %"),
    ],
)
def test_a_share_is_all_or_none_only_where_it_is(part: int, whole: int, words: str) -> None:
    assert percent(part / whole) == words


def test_a_share_in_digits_is_0_or_1_only_where_it_is() -> None:
    shares = (1999 / 2000, 0.9996, 1.0, 0.0001, 0.0, 2 / 3)
    assert [share_text(share, 3) for share in shares] == ["0.999", "0.999", "1.000", "0.001", "0.000", "0.667"]


def test_a_count_has_its_plural() -> None:
    assert [counted(1, "goal"), counted(2, "goal"), counted(2, "leaf", "leaves")] == ["1 goal", "2 goals", "2 leaves"]
