"""Nearest neighbours: what the k-d tree finds is what looking at every row finds."""

from __future__ import annotations

import numpy as np
import pytest
from fbql_fusion.core.tasks.soccer.world_model.neighbours import fit_neighbours, nearest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray


@given(
    arrays(np.float64, st.tuples(st.integers(1, 60), st.just(3)), elements=st.integers(-4, 4).map(float)),
    arrays(np.float64, 3, elements=st.floats(-6.0, 6.0)),
    st.integers(1, 5),
)
def test_the_rows_found_are_no_farther_than_those_of_a_search_through_all(
    x: NDArray[np.float64], query: NDArray[np.float64], count: int
) -> None:
    neighbours = fit_neighbours(x, np.arange(float(len(x)))[:, None])
    scale = np.where(x.std(axis=0) < 1e-12, 1.0, x.std(axis=0))
    squares = (((x - query) / scale) ** 2).sum(axis=1)
    rows = nearest(neighbours, query, count)
    assert len(set(rows.tolist())) == len(rows) == min(count, len(x))
    kept = neighbours.outputs[rows, 0].astype(int)
    assert squares[kept] == pytest.approx(np.sort(squares)[:count])


def test_with_many_rows_few_of_those_found_are_far_from_the_nearest() -> None:
    rng = np.random.default_rng(1)
    x = np.cumsum(rng.normal(size=(20_000, 6)), axis=0)  # rows along a path, as real steps are
    neighbours = fit_neighbours(x, np.arange(float(len(x)))[:, None])
    queries = x[rng.integers(len(x), size=50)] + rng.normal(size=(50, 6))
    misses = 0
    for query in queries:
        squares = (((x - query) / neighbours.scale) ** 2).sum(axis=1)
        (row,) = nearest(neighbours, query, 1)
        misses += squares[int(neighbours.outputs[row, 0])] > squares.min()
    assert misses <= 5


def test_a_search_among_many_rows_that_are_all_far_ends_before_it_is_exact() -> None:
    rng = np.random.default_rng(2)
    x, queries = rng.normal(size=(3000, 12)), rng.normal(size=(30, 12))
    neighbours = fit_neighbours(x, np.arange(float(len(x)))[:, None])
    exact = [int((((x - query) / neighbours.scale) ** 2).sum(axis=1).argmin()) for query in queries]
    found = [int(neighbours.outputs[nearest(neighbours, query, 1)[0], 0]) for query in queries]
    assert sum(a != b for a, b in zip(exact, found, strict=True)) > 5


def test_every_node_divides_its_rows_in_the_middle_along_the_input_that_varies_most() -> None:
    rng = np.random.default_rng(1)
    x = rng.normal(size=(200, 3)) + np.array([0.0, -50.0, 5.0])
    kept = fit_neighbours(x, x)
    divided, pending = 0, [(0, 0, len(x))]
    while pending:
        node, begin, end = pending.pop()
        axis, own = kept.axes[node], kept.inputs[begin:end]
        if axis < 0:
            assert end - begin <= 12
            continue
        middle = (begin + end) // 2
        assert end - begin > 12
        assert axis == np.argmax(np.ptp(own, axis=0))
        assert kept.inputs[begin:middle, axis].max() <= kept.cuts[node] == kept.inputs[middle:end, axis].min()
        divided += 1
        pending += [(2 * node + 1, begin, middle), (2 * node + 2, middle, end)]
    assert divided == 1 + 2 + 4 + 8 + 8  # the larger half of 25 rows is divided once more


def test_inputs_of_other_units_count_alike() -> None:
    rng = np.random.default_rng(1)
    x, query = rng.normal(size=(500, 4)), rng.normal(size=4)
    units = np.array([1.0, 1000.0, 0.001, 7.0])
    y = np.arange(500.0)[:, None]
    found = [
        each.outputs[nearest(each, at, 3)].tolist()
        for each, at in ((fit_neighbours(x, y), query), (fit_neighbours(x * units, y), query * units))
    ]
    assert found[0] == found[1]


def test_an_input_that_never_changes_has_no_say() -> None:
    x = np.array([[0.0, 5.0], [1.0, 5.0], [2.0, 5.0]])
    neighbours = fit_neighbours(x, x)
    assert neighbours.outputs[nearest(neighbours, np.array([1.9, 5.0]), 1)].tolist() == [[2.0, 5.0]]


def test_many_rows_that_are_alike_are_no_obstacle() -> None:
    neighbours = fit_neighbours(np.zeros((1000, 2)), np.ones((1000, 1)))
    assert len(set(nearest(neighbours, np.array([3.0, 4.0]), 5).tolist())) == 5
