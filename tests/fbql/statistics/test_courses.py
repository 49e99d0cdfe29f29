"""The course of a run from success to success, by hand-made runs."""

from __future__ import annotations

import numpy as np
import pytest
from fbql.statistics.courses import MEASURES, WINDOW, courses, moving_average, successes_of
from fbql_recording.core.metrics import OUTCOMES

GOAL, OWN_GOAL, TIMEOUT = (OUTCOMES.index(each) for each in ("goal", "own_goal", "timeout"))
COURSE = [[OWN_GOAL, 100, 2, 20], [TIMEOUT, 400, 1, 5], [GOAL, 50, 3, 30], [GOAL, 60, 0, 0], [TIMEOUT, 400, 9, 9]]


def test_a_success_carries_the_failures_before_it_and_those_after_the_last_count_nowhere() -> None:
    rows = [dict(zip(MEASURES, row, strict=True)) for row in successes_of(COURSE).tolist()]
    assert rows == [
        {"failures": 2, "steps": 50, "all steps": 550, "collisions begun": 3, "contact steps": 30, "success rate": 3},
        {"failures": 0, "steps": 60, "all steps": 60, "collisions begun": 0, "contact steps": 0, "success rate": 1},
    ]


def test_a_moving_average_goes_over_the_last_successes_and_begins_with_the_first_whole_one() -> None:
    table = np.arange(1.0, 9.0)[:, None]
    assert moving_average(table)[:, 0].tolist() == [3.0, 4.0, 5.0, 6.0]
    assert len(moving_average(table[:WINDOW])) == 1
    assert len(moving_average(table[: WINDOW - 1])) == len(moving_average(table[:0])) == 0


def test_a_run_with_fewer_successes_counts_as_long_as_it_has_some() -> None:
    short = {"course": [[GOAL, 10, 0, 0]] * WINDOW}
    long = {"course": [*[[GOAL, 30, 0, 0]] * WINDOW, [OWN_GOAL, 5, 0, 0], [GOAL, 55, 0, 0]]}
    none = {"course": [[GOAL, 1000, 0, 0]] * (WINDOW - 1)}
    found = courses({"a": {(1, 0): short, (2, 0): long, (2, 1): none}})["a"]
    assert (found["first"], found["runs"]) == (WINDOW, [2, 1])
    assert found["steps"][0] == [20.0, 35.0]
    assert found["success rate"][0] == pytest.approx([1.0, 1 / 1.2], abs=1e-3)
    mean, low, high = (line[0] for line in found["steps"])
    assert low <= mean <= high
    assert (low, high) == (10.0, 30.0)


def test_a_method_without_a_success_has_no_course() -> None:
    assert courses({"a": {(1, 0): {"course": [[TIMEOUT, 9, 0, 0]]}}}) == {"a": {}}
