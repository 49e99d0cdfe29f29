"""The boxes of half-splits, against patterns counted one by one."""

from __future__ import annotations

import numpy as np
import pytest
from fbql_behaviors.core.boxes import edge, find_boxes
from fbql_behaviors.core.equations import entropy
from fbql_behaviors.core.observation import Feature
from fbql_behaviors.core.patterns import patterns_from_rows
from fbql_common.core.errors import BadInput
from hypothesis import given
from tree_strategies import PLANE, Row, patterns_of_rows, rows

ROWS = rows(range(4), max_size=40)


def region(levels: tuple[int, ...], index: tuple[int, ...]) -> list[tuple[float, float]]:
    return [
        (edge(f.low, f.high, k / 2**level), edge(f.low, f.high, (k + 1) / 2**level))
        for f, level, k in zip(PLANE, levels, index, strict=True)
    ]


def classes_inside(data: list[Row], box: list[tuple[float, float]]) -> list[int]:
    return [row[2] for row in data if all(low <= x < high for x, (low, high) in zip(row, box, strict=False))]


@given(ROWS)
def test_every_box_counts_the_patterns_inside_it_and_no_box_is_missing(data: list[Row]) -> None:
    halvings = (2, 3)
    boxes = find_boxes(patterns_of_rows(data), halvings)
    found = {}
    for levels, index, count, value in zip(boxes.levels, boxes.index, boxes.count, boxes.entropy, strict=True):
        found[tuple(levels.tolist()), tuple(index.tolist())] = int(count), float(value)
    expected = {}
    for levels in np.ndindex(3, 4):
        for index in np.ndindex(*(2**level for level in levels)):
            inside = classes_inside(data, region(levels, index))
            if inside:
                expected[levels, index] = len(inside), entropy([inside.count(k) for k in range(4)])
    assert found.keys() == expected.keys()
    for key, (count, value) in expected.items():
        assert found[key][0] == count
        assert found[key][1] == pytest.approx(value, abs=1e-9)


@given(ROWS)
def test_the_two_halves_of_a_box_hold_its_patterns(data: list[Row]) -> None:
    boxes = find_boxes(patterns_of_rows(data), (2, 3))
    for box in range(len(boxes)):
        for feature, halvings in enumerate((2, 3)):
            halves = [child for child in (boxes.left[box, feature], boxes.right[box, feature]) if child >= 0]
            if boxes.levels[box, feature] == halvings:
                assert halves == []
                continue
            assert sum(boxes.count[child] for child in halves) == boxes.count[box]
            for child in halves:
                step = np.zeros(2, np.int64)
                step[feature] = 1
                assert boxes.levels[child].tolist() == (boxes.levels[box] + step).tolist()
                assert child > box


def test_the_root_is_box_0_and_holds_everything() -> None:
    boxes = find_boxes(patterns_of_rows([(0.1, 0.1, 0), (3.0, -2.0, 1)]), (3, 3))
    assert boxes.levels[0].tolist() == [0, 0]
    assert boxes.count[0] == 2


def test_a_pattern_outside_of_the_root_region_counts_at_its_edge() -> None:
    boxes = find_boxes(patterns_of_rows([(-1.0, 0.0, 0), (99.0, 0.0, 0)]), (1, 0))
    assert boxes.count.tolist() == [2, 1, 1]


def test_more_regions_than_can_be_kept_are_refused() -> None:
    with pytest.raises(BadInput, match="raise min_range"):
        find_boxes(patterns_of_rows([(0.1, 0.1, 0)]), (64, 64))


def test_as_many_regions_as_can_be_kept_are_taken_and_not_one_halving_more() -> None:
    """4096 grids are 7 halvings of each of four features; the halvings of all together are at most 50."""
    features = tuple(Feature(name, "", 0.0, 1.0) for name in "abcd")
    one = patterns_from_rows(features, [(0.1, 0.2, 0.3, 0.4)], [0])
    assert len(find_boxes(one, (7, 7, 7, 7))) == 4096
    for halvings in ((8, 7, 7, 7), (51, 0, 0, 0)):
        with pytest.raises(BadInput, match="raise min_range"):
            find_boxes(one, halvings)
