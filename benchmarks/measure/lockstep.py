"""Steps per second of the lockstep graph against the same five nodes with no work in them, interleaved in one run.

For each way of running (a process for each node, one process for all) every round measures, one after the other:
our graph without recording, with recording, and the bare graph. Results are medians over the rounds, ratios are
ours / bare. `bare` passes rclpy's empty message objects, as ROS nodes in Python usually do; `bare_raw` passes bytes that
are never decoded, the least work for the middleware.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from statistics import median

import domain_coordinator

from measure.graph import MODES, TIMEOUT_S, graph_steps_per_s, parse

BARE = Path(__file__).with_name("bare_graph.py")
ROLES = ("simulator", "ball_seeking", "wall_avoiding", "approaching", "fusion")


def main(argv: Sequence[str]) -> int:
    """Runs the benchmark. Returns the exit code."""
    arguments = parse("lockstep.py", __doc__, 5, argv)
    figures: dict[str, dict[str, list[float]]] = {mode: {} for mode in MODES}
    for number in range(arguments.rounds):
        for mode, found in figures.items():
            measured = {
                "graph": graph_steps_per_s(mode, arguments.steps, record=False),
                "graph_recording": graph_steps_per_s(mode, arguments.steps, record=True),
                "bare": _bare(mode, arguments.steps, raw=False),
                "bare_raw": _bare(mode, arguments.steps, raw=True),
            }
            for name, value in measured.items():
                found.setdefault(name, []).append(value)
            words = ", ".join(f"{name} {value:.0f}" for name, value in measured.items())
            print(f"round {number + 1}/{arguments.rounds}, {mode}: {words} steps/s", file=sys.stderr, flush=True)
    result = {mode: _summary(found) for mode, found in figures.items()}
    if arguments.json:
        print(json.dumps(result))
        return 0
    for mode, row in result.items():
        print(
            f"{mode:5}",
            "  ".join(
                f"{name} {value:.2f}" if "ratio" in name else f"{name} {value:.0f}" for name, value in row.items()
            ),
        )
    return 0


def _summary(found: dict[str, list[float]]) -> dict[str, float]:
    """Medians over the rounds, of the ratios too: both sides of a ratio are measured right after each other."""

    def ratio(ours: str, baseline: str) -> float:
        return median(a / b for a, b in zip(found[ours], found[baseline], strict=True))

    return {
        **{name: median(values) for name, values in found.items()},
        "ratio": ratio("graph", "bare"),
        "ratio_recording": ratio("graph_recording", "bare"),
        "ratio_recording_raw": ratio("graph_recording", "bare_raw"),
    }


def _bare(mode: str, steps: int, raw: bool) -> float:
    ros = ["--ros-args", "-p", f"steps:={steps}", "-p", f"raw:={str(raw).lower()}"]
    with domain_coordinator.domain_id() as domain:
        environment = {**os.environ, "ROS_DOMAIN_ID": str(domain), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
        groups = [[role] for role in ROLES] if mode == "many" else [list(ROLES)]
        processes = [
            subprocess.Popen(
                [sys.executable, str(BARE), *roles, *ros], env=environment, stdout=subprocess.PIPE, text=True
            )
            for roles in groups
        ]
        try:
            return float(json.loads(processes[0].communicate(timeout=TIMEOUT_S)[0])["steps_per_s"])
        finally:
            for process in processes:
                process.terminate()
            for process in processes:
                process.wait()
