"""A baseline controller that makes no choice."""

from __future__ import annotations

from typing import Any

from fbql_common.core.types import DRIVER_BLEND, Phase

from fbql_fusion.core.controllers.interface import JointState, Selection
from fbql_fusion.core.tasks.interface import Answers


class Uniform:
    """Every behavior weighs the same, always.

    Args:
        behaviors: n.
    """

    def __init__(self, behaviors: int) -> None:
        self._selection: Selection = ((1.0 / behaviors,) * behaviors, DRIVER_BLEND, (), ())

    def begin_episode(self, phase: Phase) -> None:
        """Does nothing."""

    def select(self, moment: Any, joint_state: JointState, answers: Answers) -> Selection:
        """1/n each."""
        return self._selection
