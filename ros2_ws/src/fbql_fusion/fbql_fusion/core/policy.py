"""What a controller has learned, together with the behaviors and trees that it belongs to."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from numpy.typing import NDArray


class Policy(NamedTuple):
    """Learned values. They are meaningful only together with the behaviors and trees they were learned with."""

    kind: str
    """The controller that learned it, as `Learner.kind`."""
    behaviors: tuple[str, ...]
    """Length n, in order."""
    tree_hashes: tuple[str, ...]
    """Length n: SHA-256 of each behavior's tree."""
    leaf_counts: tuple[int, ...]
    """Length n: number of leaves of each behavior's tree."""
    arrays: Mapping[str, NDArray[Any]]
    """The learned arrays; names, shapes and types are up to the controller."""
