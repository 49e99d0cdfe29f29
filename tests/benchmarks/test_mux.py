"""The benchmark of the mux prints the figures that it promises; tests do not judge speed."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest
from places import ROOT


@pytest.mark.long
def test_the_benchmark_of_the_mux_prints_one_object_with_its_figures() -> None:
    command = [sys.executable, str(ROOT / "benchmarks" / "mux.py"), "--seconds", "2", "--json"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=250, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("\n") == 1
    found = json.loads(done.stdout)
    assert 0.0 < found["latency_ms_p50"] <= found["latency_ms_p99"] <= found["latency_ms_max"]
    assert found["through_ms_p50"] > found["latency_ms_p50"]
    assert found["commands"] >= 200
    assert found["decision_us"] > 0.0
