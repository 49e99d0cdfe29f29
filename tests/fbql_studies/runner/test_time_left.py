"""How long a study will still take, from the first task that has ended on."""

from __future__ import annotations

import pytest
from fbql_studies.runner.workers import time_left_s
from hypothesis import given
from hypothesis import strategies as st


@pytest.mark.parametrize("workers", [1, 2, 4, 8])
@pytest.mark.parametrize("tasks", [1, 8, 16])
def test_tasks_that_take_equally_long_end_when_it_says_whatever_the_number_of_workers(workers: int, tasks: int) -> None:
    took_s = 10.0
    for done in range(1, tasks + 1):
        rounds = -(-done // workers)
        left = tasks - done
        last_of_round = done % workers == 0 or left == 0
        if last_of_round:
            elapsed_s = rounds * took_s
            expected_s = left * took_s / min(workers, left) if left else 0.0
            assert time_left_s(elapsed_s, [took_s] * done, left, workers) == pytest.approx(expected_s)


def test_what_runs_already_is_part_of_the_work_that_is_done() -> None:
    """Two workers, four tasks of 10 s: when the first has ended, the second is about to."""
    assert time_left_s(10.0, [10.0], 3, 2) == pytest.approx(10.0)


def test_nothing_is_known_before_a_task_has_ended() -> None:
    assert time_left_s(5.0, [], 3, 2) == 0.0


@given(
    st.floats(0.0, 1e6),
    st.lists(st.floats(0.0, 1e5), max_size=20),
    st.integers(0, 1000),
    st.integers(1, 64),
)
def test_it_is_never_less_than_nothing(elapsed_s: float, took_s: list[float], left: int, workers: int) -> None:
    assert time_left_s(elapsed_s, took_s, left, workers) >= 0.0
