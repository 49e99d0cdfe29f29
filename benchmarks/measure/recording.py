"""What recording costs the lockstep graph: its steps per second with a recording against without, interleaved.

For each way of running (a process for each node, one process for all) every round measures the graph with and without,
one right after the other, the next round the other way round. `many` and `one` are the medians, over the rounds, of
with / without; `steps_per_s` has the medians of each.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from statistics import median

from measure.graph import MODES, graph_steps_per_s


def main(argv: Sequence[str]) -> int:
    """Runs the benchmark. Gives the exit code."""
    parser = argparse.ArgumentParser(
        prog="recording.py", description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--rounds", type=int, default=7, metavar="N", help="rounds to take medians over (7)")
    parser.add_argument("--steps", type=int, default=8000, metavar="N", help="steps of each measurement, about (8000)")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    arguments = parser.parse_args(list(argv))
    for name in ("rounds", "steps"):
        if getattr(arguments, name) < 1:
            print(f"recording.py: --{name} is {getattr(arguments, name)}; it must be 1 or more", file=sys.stderr)
            return 2
    found: dict[str, dict[str, list[float]]] = {mode: {"recording": [], "without": []} for mode in MODES}
    for number in range(arguments.rounds):
        for mode, values in found.items():
            for name in sorted(values, reverse=number % 2 == 1):
                values[name].append(graph_steps_per_s(mode, arguments.steps, record=name == "recording"))
            words = ", ".join(f"{name} {figures[-1]:.0f}" for name, figures in values.items())
            print(f"round {number + 1}/{arguments.rounds}, {mode}: {words} steps/s", file=sys.stderr, flush=True)
    ratios = {mode: median(map(_ratio, values["recording"], values["without"])) for mode, values in found.items()}
    speeds = {mode: {name: median(figures) for name, figures in values.items()} for mode, values in found.items()}
    if arguments.json:
        print(json.dumps({**ratios, "steps_per_s": speeds, "rounds": arguments.rounds}))
        return 0
    for mode, ratio in ratios.items():
        speed = speeds[mode]
        print(f"{mode:5} {ratio:.3f}  recording {speed['recording']:.0f}  without {speed['without']:.0f} steps/s")
    return 0


def _ratio(recording: float, without: float) -> float:
    return recording / without
