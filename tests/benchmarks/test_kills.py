"""The study of kills: what it plans, and that a run with a kill is seen as it is."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

from places import ROOT


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
