"""Priorities as a guide: of the sources that may drive, and that their condition allows, the highest drives."""

from __future__ import annotations

import pytest
from fbql_common.core.types import DRIVER_BLEND
from fbql_fusion.core.guides.priorities import Priorities, Within
from fbql_fusion.core.tasks.twist.answers import SourceLeaves
from fbql_fusion.core.tasks.twist.moment import MuxMoment
from rail import SPACE

LEAVES = SourceLeaves(SPACE)


def moment(*observed: tuple[float, ...]) -> MuxMoment:
    """A moment at which this is sensed."""
    return MuxMoment(0, 0, 0, observed)


@pytest.mark.parametrize(
    ("priorities", "active", "driver"),
    [
        ((1, 5, 3), (True, True, True), 1),
        ((1, 5, 3), (True, False, True), 2),
        ((4, 4, 4), (False, True, True), 1),
        ((0, 0, 1), (True, True, False), DRIVER_BLEND),
        ((1, 2, 3), (False, False, False), DRIVER_BLEND),
    ],
)
def test_the_highest_that_may_drive_drives_and_the_first_among_equals_but_never_one_of_priority_0(
    priorities: tuple[int, ...], active: tuple[bool, ...], driver: int
) -> None:
    answers = [LEAVES.answer((0.1, 0.0), may) for may in active]
    assert Priorities(priorities).driver(moment(), answers) == driver
    assert Priorities(priorities).driver(moment(), [a if a.active else None for a in answers]) == driver


@pytest.mark.parametrize(("front_m", "driver"), [(0.1, 2), (0.3, 2), (0.31, 1), (0.5, 1), (0.51, 0), (None, 0)])
def test_a_source_with_a_condition_is_taken_only_while_it_holds(front_m: float | None, driver: int) -> None:
    guide = Priorities((1, 2, 3), (None, Within(1, 0, high=0.5), Within(1, 0, high=0.3)))
    front = () if front_m is None else (front_m,)
    assert guide.driver(moment((9.0,), front), [LEAVES.answer((0.1, 0.0))] * 3) == driver


@pytest.mark.parametrize(("front_m", "driver"), [(0.29, 0), (0.3, 1), (0.5, 1), (0.51, 0)])
def test_a_condition_holds_at_both_of_its_ends(front_m: float, driver: int) -> None:
    guide = Priorities((1, 2), (None, Within(0, 0, 0.3, 0.5)))
    assert guide.driver(moment((front_m,)), [LEAVES.answer((0.1, 0.0))] * 2) == driver


def test_where_no_condition_holds_the_lowest_that_may_drive_drives() -> None:
    guide = Priorities((2, 1), (Within(0, 0, low=5.0), Within(0, 0, low=6.0)))
    both, only_first = [LEAVES.answer((0.1, 0.0))] * 2, [LEAVES.answer((0.1, 0.0)), LEAVES.answer(None)]
    assert guide.driver(moment((1.0,)), both) == 1
    assert guide.driver(moment((1.0,)), only_first) == 0
