"""What the arrays of a policy must be, and tables that grow with the features."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from fbql_common.core.errors import BadInput
from numpy.typing import NDArray

CAPACITY = 1 << 14
"""Rows that a table has at first."""


def check_arrays(arrays: Mapping[str, NDArray[Any]], expected: Mapping[str, tuple[str, tuple[int, ...]]]) -> None:
    """Raises BadInput where an array is missing, of another kind or shape, or has a value that is not finite."""
    for name, (kind, shape) in expected.items():
        if name not in arrays:
            raise BadInput(f"the policy has no array '{name}'")
        found = arrays[name]
        if found.dtype.kind != kind or found.shape != shape:
            raise BadInput(
                f"the policy's array '{name}' is {found.dtype} {list(found.shape)}, expected kind {kind} {list(shape)}"
            )
        if kind == "f" and not np.isfinite(found).all():
            raise BadInput(f"the policy's array '{name}' has a value that is not finite")


def grown(table: NDArray[np.float64], rows: int) -> NDArray[np.float64]:
    """The table itself where it has so many rows, else a longer one with zeros below: its length is doubled."""
    capacity = len(table)
    while capacity < rows:
        capacity *= 2
    if capacity == len(table):
        return table
    return np.concatenate([table, np.zeros((capacity - len(table), *table.shape[1:]))])


def padded(table: NDArray[np.float64], rows: int) -> NDArray[np.float64]:
    """A copy with so many rows, at least as many as there are; those added are zeros."""
    longer = np.zeros((rows, *table.shape[1:]))
    longer[: len(table)] = table
    return longer
