"""The guide as a controller, in every episode."""

from __future__ import annotations

from typing import Any

from fbql_common.core.types import Phase

from fbql_fusion.core.controllers.interface import JointState, Selection, one_hot_weights
from fbql_fusion.core.tasks.interface import Answers, Guide


class Guided:
    """The behavior that the guide chooses drives alone.

    Args:
        behaviors: n.
    """

    def __init__(self, guide: Guide, behaviors: int) -> None:
        self._guide = guide
        self._selections: list[Selection] = [
            (weights, driver, (), ()) for driver, weights in enumerate(one_hot_weights(behaviors))
        ]
        self._selections.append(((0.0,) * behaviors, -1, (), ()))

    def begin_episode(self, phase: Phase) -> None:
        """Does nothing: nothing is remembered from one step to the next."""

    def select(self, moment: Any, joint_state: JointState, answers: Answers) -> Selection:
        """Weight 1 for the driver; all weights are 0 if the guide chooses none."""
        return self._selections[self._guide.driver(moment, answers)]
