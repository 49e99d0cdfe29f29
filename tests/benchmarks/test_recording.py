"""The benchmark of recording tells what it says it tells; how fast things are is not a test's business."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest
from places import ROOT


@pytest.mark.long
def test_the_benchmark_of_recording_prints_one_object_with_its_ratios() -> None:
    command = [sys.executable, str(ROOT / "benchmarks" / "recording.py"), "--rounds", "1", "--steps", "800", "--json"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=250, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("\n") == 1
    found = json.loads(done.stdout)
    for mode in ("many", "one"):
        speeds = found["steps_per_s"][mode]
        assert found[mode] == pytest.approx(speeds["recording"] / speeds["without"])
        assert 0.2 < found[mode] < 5.0
