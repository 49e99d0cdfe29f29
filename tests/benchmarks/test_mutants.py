"""The mutation study: what it changes, what it leaves alone, and what it says."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from places import ROOT

SOURCE = '''"""A text with 1 < 2 in it."""

LIMIT: int = 3


def f(a: int, b: int = 1) -> int:
    """1 + 1"""
    if a < b and not b:
        print(f"{a + 1}")
    return g(a, b) - 2
'''


@pytest.fixture
def measured(monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.syspath_prepend(str(ROOT / "benchmarks"))
    from measure import mutants

    return mutants


def test_every_mutant_is_one_change_that_parses_and_no_text_is_changed(measured: Any) -> None:
    found = measured.mutants_of(SOURCE)
    changes = {(each.line, each.before, each.after) for each in found}
    assert changes == {
        (3, "3", "4"),
        (3, "3", "2"),
        (6, "1", "2"),
        (6, "1", "0"),
        (8, "a < b", "a <= b"),
        (8, "a < b and not b", "a < b or not b"),
        (8, "not b", "b"),
        (9, 'print(f"{a + 1}")', "pass"),
        (10, "return g(a, b) - 2", "return None"),
        (10, "g(a, b) - 2", "g(a, b) + 2"),
        (10, "g(a, b)", "g(b, a)"),
        (10, "2", "3"),
        (10, "2", "1"),
    }
    for each in found:
        compile(each.source, "mutant", "exec")
        changed = [number for number, (old, new) in enumerate(
            zip(SOURCE.splitlines(), each.source.splitlines(), strict=True), start=1) if old != new]  # fmt: skip
        assert changed == [each.line]


def test_every_core_has_mutants(measured: Any) -> None:
    cores = {each.core for each in measured.candidates(measured.CORES)}
    assert cores == set(measured.CORES)


def test_a_study_continues_where_it_stopped_and_lists_survivors(
    measured: Any, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """Without pytest: every second mutant survives."""
    tried: list[Any] = []

    def run_tests(_place: Path, _core: str, first: list[str]) -> tuple[int, str, bool]:
        tried.append(first)
        return (0 if len(tried) % 2 else 1), "FAILED a test", True

    monkeypatch.setattr(measured, "run_tests", run_tests)
    monkeypatch.setattr(measured, "_check_unchanged", lambda *_: None)
    words = ["--seed", "4", "--core", "fbql_common", "--out", str(tmp_path / "out.jsonl"), "--json"]
    assert measured.main(["--runs", "4", *words]) == 0
    assert (len(tried), len((tmp_path / "out.jsonl").read_text().splitlines())) == (4, 4)
    with (tmp_path / "out.jsonl").open("a") as file:
        file.write('{"cut off')
    capsys.readouterr()
    assert measured.main(["--runs", "4", *words]) == 0
    assert len(tried) == 4
    assert measured.main(["--runs", "6", *words]) == 0
    assert measured.main(["--runs", "6", *words]) == 0
    assert len(tried) == 6, "what was cut off spoils no later line"
    capsys.readouterr()
    assert measured.main(["--runs", "4", *words]) == 0
    result = json.loads(capsys.readouterr().out)
    assert (result["cores"]["fbql_common"]["killed"], result["cores"]["all"]["mutants"]) == (2, 4)
    assert len(result["survivors"]) == 2
    assert all("fbql_common/core/" in line and " -> " in line for line in result["survivors"])
    assert measured.main(["--runs", "0"]) == 2
