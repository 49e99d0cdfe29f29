"""Which parts of the root region were demonstrated, and which ones play needs."""

from __future__ import annotations

import numpy as np
import pytest
from fbql_behaviors.core.coverage import CELLS, coverage_of
from fbql_behaviors.core.observation import Feature, observation_of
from fbql_behaviors.drawing.coverage import coverage_svg
from hypothesis import given
from hypothesis import strategies as st

SEEKING = observation_of("ball_seeking").features
UNIT = (Feature("a", "m", 0.0, 8.0), Feature("b", "m", 0.0, 8.0))


def rows(*places: tuple[float, ...]) -> np.ndarray:
    return np.array(places, np.float64).reshape(len(places), -1)


def test_what_was_driven_in_and_never_shown_is_named_in_words_the_most_first() -> None:
    shown = rows((0.1, 0.0), (0.1, 0.1))
    driven = rows(*[(0.1, 0.1)] * 6, *[(1.0, -3.0)] * 3, (3.0, 1.0))
    found = coverage_of(SEEKING, shown, driven)
    assert [gap.share for gap in found.gaps()] == [0.3, 0.1]
    assert found.gaps()[0].where == "ball 0.8-1.2 m away, 135-180 degrees to the right, behind"
    assert found.share_shown == 0.6
    assert len(found.gaps(1)) == 1


def test_the_map_has_the_first_feature_to_the_right_and_the_second_upwards() -> None:
    found = coverage_of(UNIT, rows((0.5, 0.5), (7.5, 0.5)), rows((0.5, 7.5), (7.5, 0.5)))
    lines = found.map()
    assert [len(line) for line in lines] == [CELLS] * CELLS
    assert lines[0] == "?......."
    assert lines[-1] == "#......#"
    assert set("".join(lines[1:-1])) == {"."}


def test_one_feature_is_one_line_and_three_have_no_map() -> None:
    assert coverage_of(UNIT[:1], rows((0.5,)), rows((7.5,))).map() == ["#......?"]
    three = (*UNIT, Feature("c", "", 0.0, 1.0))
    assert coverage_of(three, rows((0.5, 0.5, 0.5)), rows((0.5, 0.5, 0.5))).map() == []


def test_where_it_never_drove_nothing_is_missing() -> None:
    found = coverage_of(UNIT, rows((0.5, 0.5)), np.zeros((0, 2)))
    assert (found.gaps(), found.share_shown) == ([], None)


def test_a_cell_is_an_eighth_of_the_range_wherever_that_begins() -> None:
    for low in (-6.0, -4.0, 2.0):
        feature = Feature("a", "m", low, low + 8.0)
        found = coverage_of((feature,), rows(*((low + x,) for x in (0.5, 2.9, 3.0, 7.5))), rows((low + 3.5,)))
        assert found.shown.tolist() == [1, 0, 1, 1, 0, 0, 0, 1]
        assert found.driven.tolist() == [0, 0, 0, 1, 0, 0, 0, 0]


@given(st.lists(st.tuples(st.floats(-20.0, 20.0), st.floats(-20.0, 20.0)), min_size=1, max_size=30))
def test_every_moment_counts_once_also_outside_of_the_root_region(places: list[tuple[float, float]]) -> None:
    found = coverage_of(UNIT, rows(*places), rows(*places))
    assert int(found.driven.sum()) == len(places)
    assert found.gaps() == []
    assert found.share_shown == 1.0


@pytest.mark.parametrize("d", [1, 2])
def test_the_picture_marks_what_is_to_be_shown_with_more_than_a_colour(d: int) -> None:
    shown, driven = rows((0.5,) * d), rows((7.5,) * d, (7.5,) * d)
    text = coverage_svg(coverage_of(UNIT[:d], shown, driven))
    assert text.count(">?</text>") == 1
    assert text.count("<rect") == CELLS**d + 3 + 1
