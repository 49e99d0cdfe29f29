"""The results of a long study: appended row by row, each completely or not at all, and read again."""

from __future__ import annotations

from pathlib import Path
from types import ModuleType

import pytest
from fbql.cli.output import Unwritable
from file_limit import largest_file
from places import ROOT


@pytest.fixture
def rows(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(str(ROOT / "benchmarks"))
    from measure import rows

    return rows


def test_a_full_disk_ends_the_study_in_one_line_and_loses_no_row_before(rows: ModuleType, tmp_path: Path) -> None:
    path = tmp_path / "new" / "rows.jsonl"
    what = r"rows\.jsonl: cannot be written \(File too large\); make room"
    with largest_file(40), pytest.raises(Unwritable, match=what), rows.row_appender(path) as append:
        for number in range(10):
            append({"number": number})
    assert rows.read_rows(path) == [{"number": 0}, {"number": 1}]
    with rows.row_appender(path) as append:
        append({"number": 2})
    assert [row["number"] for row in rows.read_rows(path)] == [0, 1, 2]


def test_where_not_one_row_fits_no_file_is_left(rows: ModuleType, tmp_path: Path) -> None:
    path = tmp_path / "rows.jsonl"
    with largest_file(3), pytest.raises(Unwritable), rows.row_appender(path) as append:
        append({"number": 0})
    assert list(tmp_path.iterdir()) == []
    assert rows.read_rows(path) == []


def test_a_line_that_was_cut_off_is_left_out_and_the_next_row_begins_a_line(rows: ModuleType, tmp_path: Path) -> None:
    path = tmp_path / "rows.jsonl"
    path.write_text('{"number": 0}\n{"numb')
    with rows.row_appender(path) as append:
        append({"number": 1})
        append({"number": 2})
    assert [row["number"] for row in rows.read_rows(path)] == [0, 1, 2]


def test_a_line_that_is_cut_off_or_not_utf8_is_left_out(rows: ModuleType, tmp_path: Path) -> None:
    path = tmp_path / "rows.jsonl"
    path.write_bytes(b'{"number": 0}\n{"name": "\xff"}\n{"number": 1}\n{"num')
    assert rows.read_rows(path) == [{"number": 0}, {"number": 1}]
