"""Tables as people read them."""

from __future__ import annotations

import pytest
from fbql.statistics.tables import Table, as_markdown, as_text, between, rows_as_text


def test_rows_in_words_have_aligned_columns_and_say_where_a_number_is_missing() -> None:
    rows = [{"name": "a", "value": 1.23456}, {"name": "bcd", "value": None}]
    assert rows_as_text(rows).splitlines() == ["name  value", "a     1.235", "bcd     n/a"]
    assert rows_as_text([*rows, {"n": 3}]).splitlines()[3:] == ["", "n", "3"]
    assert rows_as_text([]) == "no results"


def test_a_table_that_is_too_wide_goes_on_below() -> None:
    table = Table(["name", "first", "second", "third"], [["a", "1", "2", ""], ["bcd", "4", "5", "6"]])
    assert as_text(table, 80).splitlines() == [
        "name  first  second  third",
        "a         1       2",
        "bcd       4       5      6",
    ]
    narrow = as_text(table, 19).splitlines()
    assert narrow == [
        "name  first  second",
        "a         1       2",
        "bcd       4       5",
        "",
        "name  third",
        "a",
        "bcd       6",
    ]
    assert as_text(table, 1).splitlines()[:3] == ["name  first", "a         1", "bcd       4"], (
        "one column beside the first"
    )
    signed = Table(["what", "difference", "note"], [["a", "-1", "n/a"], ["b", "", "-0.5"], ["c", "+2", "**no**"]])
    assert as_text(signed, 80).splitlines() == [
        "what  difference  note",
        "a             -1  n/a",
        "b                 -0.5",
        "c             +2  no",
    ]
    assert as_markdown(table).splitlines()[:3] == [
        "| name | first | second | third |",
        "| --- | --- | --- | --- |",
        "| a | 1 | 2 |  |",
    ]


@pytest.mark.parametrize(
    ("ends", "told"), [((0.1, 0.4), "20 (10 to 40)"), ((0.1, None), "20 (10 to ∞)"), ((None, None), "20")]
)
def test_an_interval_is_told_where_there_is_one(ends: tuple[float | None, float | None], told: str) -> None:
    assert between({"x": 0.2, "low": ends[0], "high": ends[1]}, "x", "low", "high", ".0f", 100.0) == told
    assert between({"x": None, "low": None, "high": None}, "x", "low", "high", ".0f") == ""
