"""Our graph, started as a user does; bringup.py reports its own speed."""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from fbql.cli.parser import Parser

ROOT = Path(__file__).resolve().parents[2]
MODES = ("many", "one")
"""Ways of running: a process for each node, one process for all."""
TIMEOUT_S = 300
_STEPS_OF_AN_EPISODE = 800


def parse(program: str, description: str | None, rounds: int, argv: Sequence[str]) -> argparse.Namespace:
    """The options of a benchmark of graphs: rounds (default `rounds`), steps, json."""
    parser = Parser(prog=program, description=description, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument(
        "--rounds", type=int, default=rounds, metavar="N", help=f"rounds to take medians over ({rounds})"
    )
    parser.add_argument("--steps", type=int, default=8000, metavar="N", help="steps of each measurement, about (8000)")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    arguments = parser.parse_args(list(argv))
    for name in ("rounds", "steps"):
        if getattr(arguments, name) < 1:
            parser.error(f"--{name} is {getattr(arguments, name)}; it must be 1 or more")
    return arguments


def graph_steps_per_s(mode: str, steps: int, record: bool) -> float:
    """Steps per second of Subsumption over whole episodes of a fixed seed, about `steps` in all."""
    with tempfile.TemporaryDirectory() as directory:
        command = [sys.executable, str(ROOT / "scripts" / "bringup.py"), "--json", "--processes", mode, "--seed", "1"]
        command += ["--controller", "subsumption", "--episodes", str(max(1, steps // _STEPS_OF_AN_EPISODE))]
        command += ["--out", str(Path(directory) / "run"), "--record" if record else "--no-record"]
        done = subprocess.run(command, capture_output=True, text=True, timeout=TIMEOUT_S, check=False)
    if done.returncode != 0:
        raise RuntimeError(f"{' '.join(command)} failed:\n{done.stderr}")
    return float(json.loads(done.stdout)["steps_per_s"])
