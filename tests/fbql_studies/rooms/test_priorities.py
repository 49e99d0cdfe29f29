"""The baseline: conditions, latches and the order of priorities; and the settings among which it is tuned."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
from fbql_studies.rooms.maps import room_of
from fbql_studies.rooms.play import by_priorities
from fbql_studies.rooms.priorities import HAND_SET, NAMES, TUNED, GatedPriorities, Gates, Setting, settings
from fbql_studies.rooms.robot import BEAMS, RANGE_M, Reading, reading_of
from fbql_studies.rooms.worlds import TwinWorld

OPEN = np.full(BEAMS, RANGE_M)


def ahead(at_m: float) -> Reading:
    """Something straight ahead, the goal beyond it."""
    ranges = OPEN.copy()
    ranges[BEAMS // 2] = at_m
    return reading_of(0, (0.0, 0.0, 0.0), ranges, (5.0, 0.0), False)


def active_answers(but: int = -1) -> list[SimpleNamespace]:
    """An answer of every source; that of `but` may not drive."""
    return [SimpleNamespace(active=i != but) for i in range(len(NAMES))]


def driver(gates: Gates, reading: Reading) -> str:
    guide = GatedPriorities(gates.order)
    guide.gates = gates.open(reading)
    return NAMES[guide.driver(None, active_answers())]


def test_the_highest_source_whose_condition_holds_drives_and_the_lowest_always_may() -> None:
    gates = Gates(Setting(("back", "gap", "goal"), (0.3, 1.0)))
    assert [driver(gates, ahead(at_m)) for at_m in (0.25, 0.5, 2.0)] == ["back", "gap", "goal"]


def test_a_latch_keeps_a_source_for_its_time_and_a_reset_opens_it() -> None:
    gates = Gates(Setting(("gap", "goal"), (1.0,), latch_s=0.3))
    found = [driver(gates, ahead(at_m)) for at_m in (0.5, 2.0, 2.0, 2.0, 2.0)]
    assert found == ["gap", "gap", "gap", "gap", "goal"]
    driver(gates, ahead(0.5))
    gates.reset()
    assert driver(gates, ahead(2.0)) == "goal"


def test_a_source_that_may_not_drive_is_passed_over() -> None:
    gates = Gates(Setting(("gap", "goal"), (1.0,)))
    guide = GatedPriorities(gates.order)
    guide.gates = gates.open(ahead(0.5))
    assert NAMES[guide.driver(None, active_answers(but=NAMES.index("gap")))] == "goal"
    assert guide.driver(None, [None] * len(NAMES)) == -1


def test_the_settings_are_distinct_repeatable_and_begin_with_the_one_set_by_hand() -> None:
    found = settings(240, 1)
    assert found == settings(240, 1)
    assert found[0] == HAND_SET
    assert len(set(found)) == 240
    for order, within_m, _ in found:
        assert len(within_m) == len(order) - 1
        assert order[-1] == "goal"
        assert len(set(order)) == len(order)


def test_fewer_settings_are_the_first_of_more() -> None:
    assert settings(20, 1) == settings(40, 1)[:20]


def test_the_tuned_settings_are_among_those_that_are_searched() -> None:
    assert set(TUNED.values()) <= set(settings(240, 1))


def test_priorities_play_the_same_twice() -> None:
    rooms = [room_of("doors", seed) for seed in range(3)]
    assert [*by_priorities(TUNED["doors"], TwinWorld(0.05), rooms)] == [
        *by_priorities(TUNED["doors"], TwinWorld(0.05), rooms)
    ]
