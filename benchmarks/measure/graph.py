"""Our graph as a user starts it, timed by itself."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
MODES = ("many", "one")
"""Ways of running: a process for each node, one process for all."""
TIMEOUT_S = 300
_STEPS_OF_AN_EPISODE = 800


def graph_steps_per_s(mode: str, steps: int, record: bool) -> float:
    """Subsumption, whole episodes of a fixed seed, until about `steps` are played; steps per second."""
    with tempfile.TemporaryDirectory() as directory:
        command = [sys.executable, str(ROOT / "scripts" / "bringup.py"), "--json", "--processes", mode, "--seed", "1"]
        command += ["--controller", "subsumption", "--episodes", str(max(1, steps // _STEPS_OF_AN_EPISODE))]
        command += ["--out", str(Path(directory) / "run"), "--record" if record else "--no-record"]
        done = subprocess.run(command, capture_output=True, text=True, timeout=TIMEOUT_S, check=False)
    if done.returncode != 0:
        raise RuntimeError(f"{' '.join(command)} failed:\n{done.stderr}")
    return float(json.loads(done.stdout)["steps_per_s"])
