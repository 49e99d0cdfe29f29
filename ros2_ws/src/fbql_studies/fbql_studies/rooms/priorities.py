"""The baseline: sources that publish only in some situations, in front of a mux with fixed priorities.

This is how priorities are used on robots: a source of high priority is silent until its own condition holds, and for a while
after. The learned mux gets the same sources without any condition, except in the study's variant with gated sources.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from fbql_fusion.core.tasks.interface import Answers

from fbql_studies.rooms.robot import PERIOD_S, Reading
from fbql_studies.rooms.sources import SOURCES, sectors, way_to_goal

NAMES = tuple(SOURCES)


class Setting(NamedTuple):
    """Priorities with the conditions of the sources."""

    order: tuple[str, ...]
    """Sources from the highest priority to the lowest, which always publishes. Those that are missing never do."""
    within_m: tuple[float, ...]
    """For each but the last: it publishes while something is nearer than this: ahead for `gap` and `back`, on the way to the goal
    for all others."""
    latch_s: float = 0.0
    """How long a source continues to publish after its condition has ended."""


HAND_SET = Setting(("back", "gap", "goal"), (0.35, 1.0))
"""Priorities as a person would set them without any tuning."""


class Gates:
    """Which sources publish now, by their own conditions."""

    def __init__(self, setting: Setting) -> None:
        self._rules = [
            (NAMES.index(name), name, within) for name, within in zip(setting.order, setting.within_m, strict=False)
        ]
        self._always = NAMES.index(setting.order[-1])
        self._latch = round(setting.latch_s / PERIOD_S)
        self._left = [0] * len(NAMES)
        self.order = [index for index, *_ in self._rules] + [self._always]

    def reset(self) -> None:
        """Begins an episode: nothing is latched."""
        self._left = [0] * len(NAMES)

    def open(self, reading: Reading) -> list[bool]:
        """Whether each of SOURCES publishes. Takes every reading of an episode in order."""
        _, *front, _ = sectors(reading.ranges)
        wide, ahead = min(front), front[1]
        way = way_to_goal(reading.ranges, reading.goal_distance_m, reading.goal_bearing_rad)
        left, found = self._left, [False] * len(NAMES)
        for index, name, within in self._rules:
            if (wide if name == "back" else ahead if name == "gap" else way) < within:
                left[index] = self._latch + 1
            if left[index]:
                left[index] -= 1
                found[index] = True
        found[self._always] = True
        return found


class GatedPriorities:
    """The guide: of the sources whose gates are open, the first in the order. `gates` is what `Gates.open` returned at this moment."""

    def __init__(self, order: Sequence[int]) -> None:
        self._order = tuple(order)
        self.gates: list[bool] = []

    def driver(self, _moment: object, answers: Answers) -> int:
        """See `core.tasks.interface.Guide`."""
        for i in self._order:
            answer = answers[i]
            if self.gates[i] and answer is not None and answer.active:
                return i
        return -1


_BACK_M = (0.25, 0.3, 0.35, 0.4, 0.5)
_GAP_M = (0.4, 0.5, 0.7, 0.9, 1.2, 1.6, 2.0)
_WALL_M = (0.5, 0.7, 0.9, 1.2, 1.6, 2.0, 2.5)
_LATCH_S = (0.0, 0.4, 0.8, 1.6, 3.2)


def settings(count: int, seed: int) -> list[Setting]:
    """The settings among which priorities are tuned: the hand-set one, then random ones without repetition.

    The goal is the lowest of all; of the other sources, two to four take part in any order.
    """
    generator = np.random.default_rng(seed)
    found = [HAND_SET]
    while len(found) < count:
        above = [name for name in NAMES if name != "goal"]
        taking_part = int(generator.integers(2, len(above) + 1))
        order = [above[i] for i in generator.permutation(len(above))[:taking_part]]
        grids = [_BACK_M if name == "back" else _GAP_M if name == "gap" else _WALL_M for name in order]
        within = tuple(grid[int(generator.integers(len(grid)))] for grid in grids)
        setting = Setting((*order, "goal"), within, _LATCH_S[int(generator.integers(len(_LATCH_S)))])
        if setting not in found:
            found.append(setting)
    return found


TUNED: Mapping[str, Setting] = {
    "traps": Setting(("wall_left", "back", "wall_right", "goal"), (2.0, 0.25, 0.9)),
    "doors": Setting(("gap", "wall_left", "goal"), (0.7, 0.9), 0.4),
}
"""Family of rooms -> the best of the settings on the rooms of tuning, as `experiment.py mux` found them: the guide there."""
