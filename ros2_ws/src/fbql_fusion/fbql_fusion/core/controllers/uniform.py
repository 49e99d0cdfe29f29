"""A baseline controller that makes no choice."""

from __future__ import annotations

from collections.abc import Sequence

from fbql_common.core.types import DRIVER_BLEND, BehaviorOutput, Phase, World

from fbql_fusion.core.controllers.interface import JointState, Selection
from fbql_fusion.core.controllers.parameters import SessionParameters


class Uniform:
    """Every behavior weighs the same, always."""

    def __init__(self, parameters: SessionParameters) -> None:
        n = len(parameters.behaviors)
        self._selection: Selection = ((1.0 / n,) * n, DRIVER_BLEND, (), ())

    def begin_episode(self, phase: Phase) -> None:
        """Nothing changes."""

    def select(self, world: World, joint_state: JointState, outputs: Sequence[BehaviorOutput | None]) -> Selection:
        """1/n each."""
        return self._selection
