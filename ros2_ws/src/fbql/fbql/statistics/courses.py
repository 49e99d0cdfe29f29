"""The course of runs from success to success, as in the paper's Figs. 10 to 14."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from fbql_recording.core.metrics import OUTCOMES
from numpy.typing import NDArray

from fbql.statistics.inference import Resamples
from fbql.statistics.runs import Runs

WINDOW = 5
"""Successes that the paper's moving average covers."""
MEASURES = ("failures", "steps", "all steps", "collisions begun", "contact steps", "success rate")
"""For each success: failures before it, its steps, the steps including those failures, its collisions, 1 / episodes."""
_GOAL = OUTCOMES.index("goal")
_DIGITS = 4


def courses(by_method: Mapping[str, Runs]) -> dict[str, Any]:
    """Method -> measure -> [mean, low, high] over the runs at each success from the WINDOW-th on.

    Moving averages and their 95 % intervals; empty where no run has so many successes.
    """
    return {method: _course(runs) for method, runs in by_method.items()}


def _course(runs: Runs) -> dict[str, Any]:
    tables = [successes_of(run["course"]) for run in runs.values()]
    longest = max((len(table) for table in tables), default=0)
    if longest < WINDOW:
        return {}
    values = np.full((len(tables), longest - WINDOW + 1, len(MEASURES)), np.nan)
    for table, row in zip(tables, values, strict=True):
        found = moving_average(table)
        row[: len(found)] = found
    resamples = Resamples([tree for tree, _ in runs])
    told: dict[str, Any] = {"first": WINDOW, "runs": (~np.isnan(values[:, :, 0])).sum(axis=0).tolist()}
    for i, measure in enumerate(MEASURES):
        band = resamples.mean_band(values[:, :, i])
        if measure == "success rate":  # averaged as episodes per success
            band = 1.0 / band[[0, 2, 1]]
        told[measure] = [[float(f"{x:.{_DIGITS}g}") for x in line] for line in band.tolist()]
    return told


def successes_of(course: Sequence[Sequence[int]]) -> NDArray[np.float64]:
    """A row of MEASURES for each success of a run; "success rate" holds the number of episodes that it took.

    Args:
        course: [outcome, steps, collisions begun, contact steps] of each episode, in order; outcome is an index of OUTCOMES.
    """
    rows: list[tuple[int, ...]] = []
    failures = before = 0
    for outcome, steps, begun, contact in course:
        if outcome == _GOAL:
            rows.append((failures, steps, before + steps, begun, contact, failures + 1))
            failures = before = 0
        else:
            failures += 1
            before += steps
    return np.array(rows, dtype=np.float64).reshape(-1, len(MEASURES))


def moving_average(table: NDArray[np.float64]) -> NDArray[np.float64]:
    """The mean of each WINDOW consecutive rows, [rows - WINDOW + 1, columns]; no rows where there are fewer."""
    sums = np.cumsum(np.vstack([np.zeros_like(table[:1]), table]), axis=0)
    return (sums[WINDOW:] - sums[:-WINDOW]) / WINDOW
