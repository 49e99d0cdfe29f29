"""Which parts of the root region were demonstrated, and which ones play needs: a grid of cells, each half of a half of a half."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from fbql_behaviors.core.explanation import conditions
from fbql_behaviors.core.observation import Feature

CELLS = 8
"""Cells along a feature."""
SHOWN, NEEDED, NOT_NEEDED = "#", "?", "."
"""In a map: cells with a pattern, cells without one in which the behavior drove, and all others."""


class Gap(NamedTuple):
    """A part of the root region without a pattern, in which the behavior drove."""

    where: str
    """In words."""
    share: float
    """Of the moments in which it drove."""


@dataclass(frozen=True)
class Coverage:
    """Which cells were demonstrated, and which were driven in.

    shown, driven: int64 [CELLS] * d, the number of patterns and of moments in each cell.
    """

    features: tuple[Feature, ...]
    shown: npt.NDArray[np.int64]
    driven: npt.NDArray[np.int64]

    def gaps(self, most: int = 3) -> list[Gap]:
        """The cells that were driven in most but never demonstrated."""
        missing = np.where(self.shown == 0, self.driven, 0)
        moments = max(int(self.driven.sum()), 1)
        gaps: list[Gap] = []
        for place in np.argsort(-missing, axis=None, kind="stable")[:most].tolist():
            cell = [place // CELLS**k % CELLS for k in reversed(range(missing.ndim))]
            count = int(missing[tuple(cell)])
            gaps += [Gap(self._words(cell), count / moments)] if count else []
        return gaps

    @property
    def share_shown(self) -> float | None:
        """Share of the moments in which the behavior drove that lie in cells with a pattern; None where it never drove."""
        moments = int(self.driven.sum())
        return int(self.driven[self.shown > 0].sum()) / moments if moments else None

    def map(self) -> list[str]:
        """The grid as lines of characters, with the first feature to the right and the second upwards; empty for more than
        two features."""
        if len(self.features) > 2:
            return []
        marks = np.where(self.shown > 0, SHOWN, np.where(self.driven > 0, NEEDED, NOT_NEEDED)).reshape(CELLS, -1)
        return ["".join(row) for row in marks.T[::-1].tolist()]

    def _words(self, cell: Sequence[int]) -> str:
        region = tuple(
            (
                feature.low + k * (feature.high - feature.low) / CELLS,
                feature.low + (k + 1) * (feature.high - feature.low) / CELLS,
            )
            for feature, k in zip(self.features, cell, strict=True)
        )
        return ", ".join(conditions(self.features, region))


def coverage_of(
    features: tuple[Feature, ...], shown: npt.NDArray[np.float64], driven: npt.NDArray[np.float64]
) -> Coverage:
    """The coverage by patterns [n, d] of what was observed where the behavior drove [m, d]."""
    return Coverage(features, _counts(features, shown), _counts(features, driven))


def _counts(features: tuple[Feature, ...], x: npt.NDArray[np.float64]) -> npt.NDArray[np.int64]:
    """How many observations lie in each cell; those outside the root region count for the cell at its edge."""
    low, high = (np.array([getattr(feature, end) for feature in features]) for end in ("low", "high"))
    cells = np.clip(((x - low) / (high - low) * CELLS).astype(np.int64), 0, CELLS - 1)
    counts = np.zeros((CELLS,) * len(features), np.int64)
    np.add.at(counts, tuple(cells.T), 1)
    return counts
