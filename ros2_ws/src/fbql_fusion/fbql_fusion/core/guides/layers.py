"""Layers in the order of their priority: the highest that is triggered drives alone (Brooks 1986)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from fbql_common.core.types import DRIVER_BLEND

from fbql_fusion.core.tasks.interface import Answer, Answers

Trigger = Callable[[Any, Answer], bool]
"""Whether a behavior wants to drive, given the moment and its own answer to it."""


class Layer(NamedTuple):
    """One layer: a behavior, and when it suppresses the layers below."""

    behavior: int
    """Index of the behavior."""
    trigger: Trigger


def driver_of(layers: Sequence[Layer], moment: Any, answers: Answers) -> int:
    """Index of the behavior that drives: of the highest triggered layer whose behavior answered.

    If no trigger fires, the lowest layer whose behavior answered drives, since there is none below it.

    Returns:
        The index, or DRIVER_BLEND where no layer's behavior answered.
    """
    lowest = DRIVER_BLEND
    for behavior, trigger in layers:
        answer = answers[behavior]
        if answer is not None and answer.active:
            if trigger(moment, answer):
                return behavior
            lowest = behavior
    return lowest
