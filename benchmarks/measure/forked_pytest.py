"""Runs test modules, each in a process forked from this one, which has imported pytest and the libraries, but none of our code.

A request is a line of JSON on stdin:

    {"module": path, "first": [test, ...], "others": bool, "limit_s": {test: CPU time} or null, "watched": folder or ""}

The tests in `first` run in that order, then, if asked for, the others, until one fails or takes more than its limit; "" is
the limit of imports and of tests that are not named. The answer is a line of JSON on stdout:

    {"code": pytest's exit code, or null, "failed": test or "", "tests": {test: {"cpu_s": time, "lines": [[file, line], ...]}}}

Without a code the process did not end by itself. Lines are those below `watched` that the test executed; what was executed
by an import, or by a fixture that several tests of the module share, is under the name "".
"""

from __future__ import annotations

import contextlib
import json
import math
import os
import resource
import select
import signal
import sys
from collections import defaultdict
from collections.abc import Generator
from errno import EDQUOT, ENOSPC
from pathlib import Path
from sys import monitoring
from tempfile import TemporaryDirectory
from time import process_time
from typing import Any

import _pytest.assertion.rewrite
import hypothesis.extra.numpy
import hypothesis.strategies
import lz4.frame
import mcap.reader
import numpy.testing
import pymunk
import pytest
import yaml
import zstandard
from hypothesis import Phase, settings

WARM = (_pytest, hypothesis, lz4, mcap, numpy, pymunk, yaml, zstandard)
PROFILE = "mutants"
OPTIONS = (
    "-q",
    "-x",
    "-m",
    "not long",
    "--tb=no",
    "-p",
    "no:cacheprovider",
    "--hypothesis-seed=0",
    f"--hypothesis-profile={PROFILE}",
)
WALL_S = 1800.0
"""Time that a module may take, however busy the machine is; a test that waits has the time limit of the suite."""
MEMORY_BYTES = 8 << 30
TOOL = 4
"""Number of the tool of sys.monitoring; Hypothesis and coverage have others."""
SHARED = ""
UNNOTED = "conftest"


def main() -> None:
    """Answers requests until stdin ends."""
    # Without shrinking: only whether a test fails matters.
    settings.register_profile(PROFILE, deadline=None, phases=[Phase.explicit, Phase.generate], database=None)
    for line in sys.stdin:
        try:
            answer = _answer(json.loads(line))
        except OSError as error:
            if error.errno not in (ENOSPC, EDQUOT):
                raise
            sys.exit(1)  # whoever asks says so
        print(json.dumps(answer), flush=True)


def _answer(request: dict[str, Any]) -> dict[str, Any]:
    with TemporaryDirectory(prefix="mutants-") as name:
        result = Path(name) / "result.json"
        process_id = os.fork()
        if not process_id:
            try:
                _run(request, result)
            finally:
                os._exit(70)
        handle = os.pidfd_open(process_id)
        select.select([handle], [], [], WALL_S)
        os.close(handle)
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process_id, signal.SIGKILL)
        os.waitpid(process_id, 0)
        with contextlib.suppress(FileNotFoundError):
            return json.loads(result.read_text())
        return {"code": None, "failed": "", "tests": {}}


def _run(request: dict[str, Any], result: Path) -> None:
    """In the forked process: runs pytest, writes the result and ends."""
    os.setsid()
    null = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1, 2):
        os.dup2(null, stream)
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
    watcher = Watcher(request)
    code = pytest.main([*OPTIONS, request["module"]], plugins=[watcher])
    answer = {"code": int(code), "failed": watcher.failed, "tests": watcher.tests()}
    unfinished = result.with_suffix(".unfinished")
    unfinished.write_text(json.dumps(answer))
    unfinished.rename(result)
    os._exit(0)


class Watcher:
    """A plugin of pytest that chooses the tests, and notes which lines each of them executes."""

    def __init__(self, request: dict[str, Any]) -> None:
        self.failed = ""
        self._module: str = request["module"]
        self._rank: dict[str, int] = {name: number for number, name in enumerate(request["first"])}
        self._others: bool = request["others"]
        self._limit_s: dict[str, float] | None = request["limit_s"]
        self._watched: str = request["watched"]
        self._lines: dict[str, set[tuple[str, int]]] = defaultdict(set)
        self._cpu_s: dict[str, float] = {SHARED: 0.0}
        self._name = SHARED
        self._limit(SHARED)
        if self._watched:
            monitoring.use_tool_id(TOOL, PROFILE)
            monitoring.register_callback(TOOL, monitoring.events.LINE, self._executed)
            monitoring.set_events(TOOL, monitoring.events.LINE)

    def tests(self) -> dict[str, dict[str, Any]]:
        """Time and lines by test."""
        return {
            name: {"cpu_s": cpu_s, "lines": sorted(self._lines[name])} for name, cpu_s in self._cpu_s.items()
        }  # fmt: skip

    def _executed(self, code: Any, line: int) -> Any:
        if self._watched and code.co_filename.startswith(self._watched):
            self._lines[self._name].add((code.co_filename[len(self._watched) :].lstrip("/"), line))
        return monitoring.DISABLE  # until events are restarted for the next test

    def _limit(self, name: str) -> None:
        """Has the process killed when it takes more than the limit from now on."""
        if self._limit_s is not None:
            end_s = process_time() + self._limit_s.get(name, self._limit_s[SHARED])
            resource.setrlimit(resource.RLIMIT_CPU, (math.ceil(end_s), resource.RLIM_INFINITY))

    @contextlib.contextmanager
    def _noting_for(self, name: str) -> Generator[None]:
        before, self._name = self._name, name
        monitoring.restart_events()
        try:
            yield
        finally:
            self._name = before
            monitoring.restart_events()

    @pytest.hookimpl(trylast=True)
    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        """Keeps the chosen tests, in their order."""
        kept = [item for item in items if self._others or item.nodeid in self._rank]
        items[:] = sorted(kept, key=lambda item: self._rank.get(item.nodeid, len(self._rank)))

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Generator[None, Any, Any]:
        """Takes the time, and notes lines for this test."""
        begun_s = process_time()
        self._limit(item.nodeid)
        with self._noting_for(item.nodeid):
            result = yield
        self._cpu_s[item.nodeid] = process_time() - begun_s
        return result

    @pytest.hookimpl(wrapper=True)
    def pytest_fixture_setup(self, fixturedef: Any) -> Generator[None, Any, Any]:
        """Attributes what a fixture shared by several tests of a module executes to all of them; fixtures of
        conftest.py are not noted."""
        if fixturedef.scope == "function":
            return (yield)
        with self._noting_for(SHARED if fixturedef.baseid == self._module else UNNOTED):
            return (yield)

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Notes the first failure."""
        if report.failed and not self.failed:
            self.failed = report.nodeid

    def pytest_collectreport(self, report: pytest.CollectReport) -> None:
        """Notes that a module cannot be imported."""
        if report.failed and not self.failed:
            self.failed = report.nodeid


if __name__ == "__main__":
    main()
