"""The study of kills: what it plans, and that a run with a kill is seen as it is."""

from __future__ import annotations

import json
import subprocess
import sys
from collections import Counter
from pathlib import Path

import pytest
from measure.kills import Plan, is_python_starting, table
from places import ROOT

SITE = '  File "<frozen site>", line 73, in <module>\n'
NODE = f'  File "{ROOT}/ros2_ws/build/fbql_sim/fbql_sim/simulator.py", line 3, in <module>\n'
DOOR = f'  File "{ROOT}/scripts/bringup.py", line 8, in <module>\n'


@pytest.mark.parametrize(
    ("phase", "frames", "raised", "excused"),
    [
        ("start", SITE, "KeyboardInterrupt", True),
        ("start", DOOR + "    from environment import enter\n", "KeyboardInterrupt", True),
        ("start", DOOR + '    enter("bringup")\n', "KeyboardInterrupt", False),
        ("start", SITE + NODE, "KeyboardInterrupt", False),
        ("start", SITE, "OSError", False),
        ("play", SITE, "KeyboardInterrupt", False),
    ],
)
def test_only_python_itself_may_be_interrupted_with_a_traceback(phase, frames, raised, excused) -> None:
    plan = Plan(1, "many", "fbql", "simulator", "SIGINT", phase, 0.5)
    assert is_python_starting(plan, f"Traceback (most recent call last):\n{frames}{raised}\n") is excused


def test_a_run_with_a_kill_is_checked_and_an_interrupted_study_goes_on(tmp_path: Path) -> None:
    results = tmp_path / "kills.jsonl"
    for runs in (1, 2):
        command = [sys.executable, str(ROOT / "benchmarks" / "kills.py"), "--runs", str(runs), "--seed", "1", "--json"]
        done = subprocess.run(
            [*command, "--out", str(results)], capture_output=True, text=True, timeout=250, check=False
        )
        assert done.returncode == 0, done.stderr
        found = json.loads(done.stdout)
        assert (found["runs"], found["faults"]) == (runs, 0)
        assert sum(row["runs"] for row in found["table"]) == runs
        rows = [json.loads(line) for line in results.read_text().splitlines()]
        assert [row["number"] for row in rows] == list(range(runs))


def test_the_documents_show_the_table_of_the_recorded_study() -> None:
    rows = [json.loads(line) for line in (ROOT / "docs" / "data" / "kills.jsonl").read_text().splitlines()]
    assert [row["number"] for row in rows] == list(range(1000))
    assert not [row["faults"] for row in rows if row["faults"]]
    shown = (ROOT / "docs" / "recordings.md").read_text()
    for line in table(rows):
        assert f"| {' | '.join(str(value) for value in line.values())} |" in shown
    recordings = Counter(row["recording"] for row in rows)
    assert recordings.keys() == {"none", "finished", "recovered", "empty"}
    for count in recordings.values():
        assert str(count) in shown
