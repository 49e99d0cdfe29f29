"""The cost of recording: steps per second of the lockstep graph with and without a recording, interleaved.

For each way of running (a process for each node, one process for all) every round measures the graph with and without,
right after each other; the order alternates from round to round. `many` and `one` are the medians, over the rounds, of
with / without; `steps_per_s` has the medians of each.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from operator import truediv
from statistics import median

from measure.graph import MODES, graph_steps_per_s, parse


def main(argv: Sequence[str]) -> int:
    """Runs the benchmark. Returns the exit code."""
    arguments = parse("recording.py", __doc__, 7, argv)
    found: dict[str, dict[str, list[float]]] = {mode: {"recording": [], "without": []} for mode in MODES}
    for number in range(arguments.rounds):
        for mode, values in found.items():
            for name in sorted(values, reverse=number % 2 == 1):
                values[name].append(graph_steps_per_s(mode, arguments.steps, record=name == "recording"))
            words = ", ".join(f"{name} {figures[-1]:.0f}" for name, figures in values.items())
            print(f"round {number + 1}/{arguments.rounds}, {mode}: {words} steps/s", file=sys.stderr, flush=True)
    ratios = {mode: median(map(truediv, values["recording"], values["without"])) for mode, values in found.items()}
    speeds = {mode: {name: median(figures) for name, figures in values.items()} for mode, values in found.items()}
    if arguments.json:
        print(json.dumps({**ratios, "steps_per_s": speeds, "rounds": arguments.rounds}))
        return 0
    for mode, ratio in ratios.items():
        speed = speeds[mode]
        print(f"{mode:5} {ratio:.3f}  recording {speed['recording']:.0f}  without {speed['without']:.0f} steps/s")
    return 0
