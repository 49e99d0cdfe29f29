"""Priorities: of the sources that may drive, the one with the highest priority drives, as in twist_mux.

With conditions (`Within`) it considers some of the sources only in some situations, which makes it Subsumption for sources that
publish all the time.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import inf
from typing import NamedTuple, Protocol

from fbql_common.core.types import DRIVER_BLEND

from fbql_fusion.core.tasks.interface import Answers


class Observed(Protocol):
    """A moment that carries its own observations."""

    @property
    def observed(self) -> tuple[tuple[float, ...], ...]:
        """Groups of numbers; an unknown group is empty."""
        ...


class Within(NamedTuple):
    """A condition: an observation lies within [low, high]. An unknown one does not."""

    group: int
    component: int
    low: float = -inf
    high: float = inf

    def holds(self, moment: Observed) -> bool:
        """Whether it holds now."""
        values = moment.observed[self.group]
        return self.component < len(values) and self.low <= values[self.component] <= self.high


class Priorities:
    """See `core.tasks.interface.Guide`.

    Args:
        priorities: of each source; the highest drives, among equals the first, and one of priority 0 or less never.
        conditions: when each source is considered; None: always. Not given: all of them always.
    """

    def __init__(self, priorities: Sequence[int], conditions: Sequence[Within | None] = ()) -> None:
        candidates = [i for i, priority in enumerate(priorities) if priority > 0]
        each = [*conditions, *[None] * (len(priorities) - len(conditions))]
        self._order = [(i, each[i]) for i in sorted(candidates, key=lambda i: -priorities[i])]

    def driver(self, moment: Observed, answers: Answers) -> int:
        """Index of the driver; if no condition of the sources that may drive holds, the lowest of them; DRIVER_BLEND if none may."""
        lowest = DRIVER_BLEND
        for i, condition in self._order:
            answer = answers[i]
            if answer is not None and answer.active:
                if condition is None or condition.holds(moment):
                    return i
                lowest = i
        return lowest
