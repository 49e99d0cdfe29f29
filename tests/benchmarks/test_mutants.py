"""The mutation study: what it changes, what it leaves alone, and what it says."""

from __future__ import annotations

import json
import resource
import tempfile
from pathlib import Path
from typing import Any

import pytest
from file_limit import largest_file
from places import ROOT

SOURCE = '''"""A text with 1 < 2 in it."""

LIMIT: int = 3


def f(a: int, b: int = 1) -> int:
    """1 + 1"""
    if a < b and not b:
        print(f"{a + 1}")
    return g(a, b) - 2


def h(a: int, b: int) -> int:
    max(a, b, f(b, a))
    return max(min(a, b), b)
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
        (14, "max(a, b, f(b, a))", "max(b, a, f(b, a))"),
        (14, "max(a, b, f(b, a))", "pass"),
        (14, "f(b, a)", "f(a, b)"),
        (15, "return max(min(a, b), b)", "return None"),
    }, "but the order of the two arguments of min and max"
    for each in found:
        compile(each.source, "mutant", "exec")
        changed = [number for number, (old, new) in enumerate(
            zip(SOURCE.splitlines(), each.source.splitlines(), strict=True), start=1) if old != new]  # fmt: skip
        assert changed == [each.line]


CORE = """LIMIT = 3
CACHED = []


def double(n: int) -> int:
    while n > LIMIT:
        n -= 1
    return n * 2


def cached() -> int:
    if not CACHED:
        CACHED.append(7)
    return CACHED[0]


def untested(n: int) -> int:
    return n + 1
"""
CORE_TESTS = """import pytest
from tiny.core.numbers import cached, double


@pytest.fixture(scope="module")
def doubled():
    return double(3)


def test_first_use():
    assert cached() > 0


def test_second_use():
    assert cached() == 7


def test_double(doubled):
    assert doubled == 6
"""


@pytest.fixture
def checkout(measured: Any, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """A checkout with one core of one file, and its tests."""
    from measure import covering

    root = tmp_path / "checkout"
    package, tests = root / "ros2_ws" / "src" / "tiny", root / "tests" / "tiny" / "core"
    (package / "tiny" / "core").mkdir(parents=True)
    tests.mkdir(parents=True)
    (root / "pyproject.toml").write_text('[tool.pytest.ini_options]\naddopts = "--import-mode=importlib"\n')
    (package / "setup.py").touch()
    (package / "tiny" / "core" / "numbers.py").write_text(CORE)
    (tests / "test_numbers.py").write_text(CORE_TESTS)
    monkeypatch.setattr(measured, "ROOT", root)
    monkeypatch.setattr(covering, "ROOT", root)
    monkeypatch.setattr(covering, "LEAST_S", 2.0)
    monkeypatch.setattr(measured, "CORES", ("tiny",))
    return root


def test_a_mutant_is_noticed_by_the_tests_that_execute_its_line(
    measured: Any, checkout: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = checkout / "out.jsonl"
    words = ["--seed", "4", "--out", str(out), "--json"]
    assert measured.main(["--runs", "5", *words]) == 0
    first = out.read_text()
    assert len(first.splitlines()) == 5
    with out.open("a") as file:
        file.write('{"cut off')
    capsys.readouterr()
    assert measured.main(["--runs", "100", *words]) == 0
    result = json.loads(capsys.readouterr().out)
    rows = [json.loads(line) for line in out.read_text().splitlines() if not line.startswith('{"cut off')]
    assert out.read_text().startswith(first), "what is known is not tried again"

    tests = {(row["line"], row["before"], row["after"]): (row["tests"], row["noticed"]) for row in rows}
    assert tests[1, "3", "2"] == (3, True), "a constant belongs to all that import it"
    assert tests[1, "3", "4"] == (3, False)
    assert tests[6, "n > LIMIT", "n >= LIMIT"] == (3, True), "a fixture of the module executes it for all"
    assert tests[13, "7", "8"] == (1, True), "a cache hides the line from the test that notices"
    assert tests[18, "n + 1", "n - 1"] == (0, False)
    assert len(rows) == len(tests) == result["cores"]["tiny"]["tried"]
    survivors = [row for row in rows if not row["noticed"]]
    assert result["cores"]["all"]["survived"] == len(result["survivors"]) == len(survivors)
    assert "ros2_ws/src/tiny/tiny/core/numbers.py:18: n + 1 -> n - 1" in result["survivors"]

    path = checkout / "tests" / "tiny" / "core" / "test_numbers.py"
    path.write_text(
        path.read_text().replace("cached, double", "cached, double, untested")
        + """

def test_untested(): assert untested(1) == 2
"""
    )
    source = checkout / "ros2_ws" / "src" / "tiny" / "tiny" / "core" / "numbers.py"
    source.write_text("# a line more\n" + source.read_text())
    assert measured.main(["--runs", "100", *words, "--again"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert "ros2_ws/src/tiny/tiny/core/numbers.py:19: n + 1 -> n - 1" not in result["survivors"]
    assert len(result["survivors"]) == len(survivors) - 4, "all that were untested, though their lines moved"
    assert len(out.read_text().splitlines()) == len(rows) + 1 + len(survivors)


def test_a_mutant_that_never_ends_is_noticed(measured: Any, checkout: Path) -> None:
    [endless] = [
        each for each in measured.candidates(["tiny"]) if (each.mutant.before, each.mutant.after) == ("n -= 1", "pass")
    ]
    path = checkout / "tests" / "tiny" / "core" / "test_numbers.py"
    path.write_text(path.read_text().replace("double(3)", "double(5)"))
    [row] = measured.study([endless], checkout / "out.jsonl")
    assert row["noticed"] and row["by"].endswith("did not end")


def test_tests_that_fail_without_a_change_end_the_study(
    measured: Any, checkout: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = checkout / "tests" / "tiny" / "core" / "test_numbers.py"
    path.write_text(path.read_text().replace("== 7", "== 8"))
    assert measured.main(["--runs", "1", "--out", str(checkout / "out.jsonl")]) == 2
    assert "test_numbers.py::test_second_use does not pass without a change either" in capsys.readouterr().err
    assert measured.main(["--runs", "0"]) == 2


def test_without_room_for_the_tests_no_mutant_counts_as_noticed(
    measured: Any, checkout: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The disk runs full after the tests have passed without a change."""
    from measure import covering

    def fill(suite: Any, *arguments: Any) -> None:
        run_unchanged(suite, *arguments)
        resource.prlimit(suite._process.pid, resource.RLIMIT_FSIZE, (10, 10))
        monkeypatch.setattr(covering, "ROOM_BYTES", 1 << 60)

    run_unchanged = covering.Suite.run_unchanged
    monkeypatch.setattr(covering.Suite, "run_unchanged", fill)
    out = checkout / "out.jsonl"
    assert measured.main(["--runs", "3", "--out", str(out)]) == 1
    said = capsys.readouterr().err.splitlines()
    assert [line for line in said if line.startswith("mutants.py: ")] == said[-1:]
    assert f"{tempfile.gettempdir()}: cannot be written" in said[-1]
    assert not out.exists()


def test_a_full_disk_is_one_line_before_anything_is_tried(
    measured: Any, checkout: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with largest_file(1000):
        assert measured.main(["--runs", "3", "--out", str(checkout / "out.jsonl")]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"mutants.py: {tempfile.gettempdir()}: cannot be written (File too large)")


def test_every_core_has_mutants_and_listed_equivalents_are_among_them(measured: Any) -> None:
    found = measured.candidates(measured.CORES)
    assert {each.core for each in found} == set(measured.CORES)
    assert len({each.key for each in found}) == len(found)
    known = measured.known_equivalents()
    assert known.keys() <= {each.key for each in found}
    assert all(known.values()), "each has a reason"
    assert all(any((ROOT / "tests").glob(name)) for name in measured.TESTS)


def test_equivalents_are_not_counted_unless_a_test_notices_them(measured: Any) -> None:
    row = {
        "core": "fbql_sim",
        "file": "f",
        "line": 1,
        "text": "a",
        "column": 0,
        "before": "1",
        "after": "2",
        "occurrence": 0,
    }
    others = [row | {"noticed": True, "text": "b"}, row | {"noticed": False, "text": "c"}]
    equivalent = {("f", "a", 0, "1", "2", 0): "it is"}
    spared = measured.summary([row | {"noticed": False}, *others], equivalent)["cores"]["all"]
    assert (spared["tried"], spared["killed"], spared["equivalent"], spared["survived"]) == (3, 1, 1, 1)
    assert spared["rate"] == 0.5
    noticed = measured.summary([row | {"noticed": True}, *others], equivalent)["cores"]["all"]
    assert (noticed["killed"], noticed["equivalent"]) == (2, 0)
