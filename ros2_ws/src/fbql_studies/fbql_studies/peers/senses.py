"""What the behaviors sense, as the input of a network."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import accumulate
from math import cos, sin

import numpy as np
from fbql_behaviors.core.behavior import Behavior
from fbql_common.core.field import MAX_WHEEL_RAD_S
from fbql_common.core.types import BehaviorOutput
from numpy.typing import NDArray


class Senses:
    """Float32 [width] in -1 .. 1. For each behavior: every feature that it senses (an angle as sine and cosine, another one
    scaled over its root range), and its reference as a share of full velocity; then each behavior's leaf, one-hot.

    Args:
        references: whether the behaviors' references are seen.
        mirror: whether situations that mirror each other (left and right) look alike. As in fbql's features
            (`fbql_fusion.core.learners.features.Scales`) the last angle decides: where it is below 0, all angles change
            their sign. Leaves stay as they are.
    """

    def __init__(self, behaviors: Sequence[Behavior], references: bool, mirror: bool) -> None:
        self._features = [behavior.tree.features for behavior in behaviors]
        self._references = references
        self._mirror = mirror
        features = [feature for own in self._features for feature in own]
        dense = sum(2 if feature.unit == "rad" else 1 for feature in features) + 2 * references * len(behaviors)
        self._first_leaf = list(accumulate([behavior.tree.leaf_count for behavior in behaviors], initial=dense))
        self.width = self._first_leaf.pop()

    def of(self, outputs: Sequence[BehaviorOutput]) -> NDArray[np.float32]:
        """Those of the behaviors' answers to a world."""
        side = -1.0 if self._mirror and self._is_turned(outputs) else 1.0
        dense: list[float] = []
        for features, output in zip(self._features, outputs, strict=True):
            for feature, value in zip(features, output.observation, strict=True):
                if feature.unit == "rad":
                    dense += (side * sin(value), cos(value))
                else:
                    share = (value - feature.low) / (feature.high - feature.low)
                    dense.append(2.0 * min(max(share, 0.0), 1.0) - 1.0)
            if self._references:
                dense += (output.left_rad_s / MAX_WHEEL_RAD_S, output.right_rad_s / MAX_WHEEL_RAD_S)
        seen = np.zeros(self.width, np.float32)
        seen[: len(dense)] = dense
        for first, output in zip(self._first_leaf, outputs, strict=True):
            seen[first + output.leaf_id] = 1.0
        return seen

    def _is_turned(self, outputs: Sequence[BehaviorOutput]) -> bool:
        angles = [
            value
            for features, output in zip(self._features, outputs, strict=True)
            for feature, value in zip(features, output.observation, strict=True)
            if feature.unit == "rad"
        ]
        return bool(angles) and angles[-1] < 0.0
