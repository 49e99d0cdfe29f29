"""The tests that can notice a mutant: those that execute its line.

Every test module runs once unchanged, in a process of its own. For a mutant only tests that execute its line run: first
those of the module that mirrors the changed file, with that module's other tests, because a cache may hide the line
from them; then those of other modules, beginning with the modules that have the least to run.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any

from fbql_common.core.errors import BadInput

from measure.rows import read_rows, row_appender

ROOT = Path(__file__).resolve().parents[2]
SOURCES = Path("ros2_ws") / "src"
FORKED = Path(__file__).with_name("forked_pytest.py")
PASSED, NO_TESTS = 0, 5
"""Exit codes of pytest."""
SHARED = ""
"""Name for code that runs outside any test, such as in an import. See forked_pytest."""
LEAST_S, FACTOR = 10.0, 5.0
"""CPU time that a test may take with a change: LEAST_S, plus FACTOR times what it takes without one."""


START_S = 0.7
"""CPU time that a module takes before its tests."""
ROOM_BYTES = 64 << 20
"""Room that the private copy, and the tests in it, have at least."""


@dataclass(frozen=True, eq=False)
class Module:
    """What is known about a test module: CPU time and executed lines of its tests."""

    path: str
    test_cpu_s: Mapping[str, float]
    lines: Mapping[str, frozenset[tuple[str, int]]]
    """By test, and for code that runs outside of any test."""

    def covering(self, file: str, lines: frozenset[int]) -> list[str]:
        """The tests that execute one of the lines, quickest first."""
        wanted = {(file, line) for line in lines}
        names = self.test_cpu_s if wanted & self.lines[SHARED] else [
            name for name in self.test_cpu_s if wanted & self.lines[name]
        ]  # fmt: skip
        return sorted(names, key=lambda name: self.test_cpu_s[name])

    def time_s(self, names: Iterable[str]) -> float:
        """CPU time of the tests."""
        return sum(self.test_cpu_s[name] for name in names)

    def within(self, budget_s: float, names: Iterable[str]) -> Iterator[str]:
        """As many of the tests, from the first, as the budget allows."""
        for name in names:
            budget_s -= self.test_cpu_s[name]
            if budget_s < 0.0:
                return
            yield name


@dataclass(frozen=True)
class Verdict:
    """The verdict of the tests on a mutant."""

    tests: int
    """Number of tests that execute its line."""
    noticed: bool
    by: str
    """The first test that failed."""


class Suite:
    """Test modules in a private copy of sources and tests, and the process that runs them."""

    def __init__(self, place: Path, process: subprocess.Popen[str]) -> None:
        self.place = place
        self._process = process
        self.modules: list[Module] = []
        self._changes = 0

    def run_unchanged(self, paths: Sequence[str], known: Path, told: Callable[[str], None]) -> None:
        """Determines what each module executes, or reads it from `known`, where earlier studies of the same sources
        stored it; appends what is new. Raises BadInput if a test fails."""
        common = _digest([*(self.place / SOURCES).rglob("*.py"), *(self.place / "tests" / "helpers").rglob("*.py")])
        answers = {row["digest"]: row["tests"] for row in read_rows(known)}
        with row_appender(known) as append:
            for number, path in enumerate(paths, start=1):
                digest = f"{path} {common} {_digest([self.place / path])}"
                if digest not in answers:
                    answer = self._run(path, [], others=True, limit_s=None, watched=str(self.place / SOURCES))
                    told(f"{number}/{len(paths)} {path}: {len(answer['tests']) - 1} tests")
                    if answer["code"] not in (PASSED, NO_TESTS):
                        raise BadInput(f"{answer['failed'] or path} does not pass without a change either")
                    answers[digest] = answer["tests"]
                    append({"digest": digest, "tests": answer["tests"]})
                self.modules.append(_module(path, answers[digest]))
        if not any(module.lines[SHARED] for module in self.modules):
            raise BadInput("the tests import no package of the private copy")

    def try_change(self, file: str, lines: frozenset[int], source: str, budget_s: float) -> Verdict:
        """Runs the tests with a changed file of the copy: those that execute one of the lines, as many as are within a
        budget of CPU time."""
        path = self.place / file
        chosen = {module: names for module in self.modules if (names := module.covering(file, lines))}
        tests, own, left_s = sum(map(len, chosen.values())), mirror(file), budget_s

        def effort(module: Module) -> tuple[bool, float]:
            return module.path != own, module.time_s(chosen[module])

        original, times = path.read_text(), path.stat()
        path.write_text(source)
        self._changes += 1  # a unique time: byte code of another version must not be used
        os.utime(path, (0, times.st_mtime + self._changes))
        try:
            for module in sorted(chosen, key=effort):
                first = list(module.within(left_s - START_S, chosen[module]))
                others = module.path == own and module.time_s(module.test_cpu_s) <= left_s - START_S
                left_s -= START_S + module.time_s(module.test_cpu_s if others else first)
                if not first:
                    break
                limit_s = {name: LEAST_S + FACTOR * cpu_s for name, cpu_s in module.test_cpu_s.items()}
                limit_s[SHARED] = LEAST_S
                answer = self._run(module.path, first, others=others, limit_s=limit_s)
                if answer["code"] not in (PASSED, NO_TESTS):
                    by = answer["failed"] or f"{module.path} " + ("failed" if answer["code"] else "did not end")
                    return Verdict(tests, True, by)
        finally:
            path.write_text(original)
            os.utime(path, ns=(times.st_atime_ns, times.st_mtime_ns))
        return Verdict(tests, False, "")

    def _run(
        self, module: str, first: Sequence[str], *, others: bool, limit_s: Mapping[str, float] | None, watched: str = ""
    ) -> dict[str, Any]:
        request = {"module": module, "first": first, "others": others, "limit_s": limit_s, "watched": watched}
        assert self._process.stdin and self._process.stdout
        self._process.stdin.write(json.dumps(request) + "\n")
        self._process.stdin.flush()
        line = self._process.stdout.readline()
        answer = json.loads(line) if line else {"code": None}
        if answer["code"] not in (PASSED, NO_TESTS):
            _check_room(self.place)  # for want of it a test fails with any change
        if not line:
            raise BadInput(f"the process that runs the tests ended with {self._process.wait()}")
        return answer


def _module(path: str, tests: Mapping[str, Mapping[str, Any]]) -> Module:
    return Module(
        path,
        {name: test["cpu_s"] for name, test in tests.items() if name != SHARED},
        {name: frozenset((str(SOURCES / file), line) for file, line in test["lines"]) for name, test in tests.items()},
    )


def _digest(paths: Iterable[Path]) -> str:
    """Of the contents of the files."""
    return sha256(b"".join(sha256(path.read_bytes()).digest() for path in sorted(paths))).hexdigest()


def mirror(file: str) -> str:
    """The test module of a file: `core/a/b.py` has `core/a/test_b.py`."""
    _, _, package, _, *folders, name = Path(file).parts
    return str(Path("tests", package, *folders, f"test_{name}"))


@contextmanager
def private_suite() -> Iterator[Suite]:
    """A suite in a copy of sources and tests, with links to everything else."""
    with tempfile.TemporaryDirectory(prefix="mutants-") as name:
        place = Path(name).resolve()
        _check_room(place)
        ignored = shutil.ignore_patterns("__pycache__", ".hypothesis", "node_modules")
        shutil.copytree(ROOT / SOURCES, place / SOURCES, ignore=ignored)
        shutil.copytree(ROOT / "tests", place / "tests", ignore=ignored)
        for path in ROOT.iterdir():
            if path.name not in ("ros2_ws", "tests", "runs", ".git", ".hypothesis"):
                (place / path.name).symlink_to(path)
        with subprocess.Popen(
            [sys.executable, "-P", str(FORKED)], cwd=place, env=environment(place), text=True,
            stdin=subprocess.PIPE, stdout=subprocess.PIPE,
        ) as process:  # fmt: skip
            try:
                yield Suite(place, process)
            finally:
                process.terminate()


def _check_room(place: Path) -> None:
    """Raises OSError where the disk of a private copy is full, or nearly."""
    try:
        with tempfile.TemporaryFile(dir=place) as file:
            os.posix_fallocate(file.fileno(), 0, ROOM_BYTES)
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(place.parent)) from None


def environment(place: Path) -> dict[str, str]:
    """Variables with which the packages of the copy are imported."""
    paths = [str(path) for path in sorted((place / SOURCES).iterdir()) if (path / "setup.py").exists()]
    paths += [os.environ["PYTHONPATH"]] if os.environ.get("PYTHONPATH") else []
    return os.environ | {"PYTHONPATH": os.pathsep.join(paths)}
