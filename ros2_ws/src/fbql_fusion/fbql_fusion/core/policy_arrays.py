"""What the arrays of a policy must be, and tables that grow with the features."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from fbql_common.core.errors import BadInput
from numpy.typing import NDArray

CAPACITY = 1 << 14
"""Rows that a table has at first."""
_TYPES = {"i": np.int64, "u": np.uint64, "f": np.float64, "b": np.bool_}


def check_arrays(arrays: Mapping[str, NDArray[Any]], expected: Mapping[str, tuple[str, tuple[int, ...]]]) -> None:
    """Raises BadInput where an array is missing, of another kind or shape, or has a value that is not finite.

    Args:
        expected: of each array its kind, "i" int64, "u" uint64, "f" float64 or "b" bool, and its shape.
    """
    for name, (kind, shape) in expected.items():
        if name not in arrays:
            raise BadInput(f"the policy has no array '{name}'")
        found = arrays[name]
        if found.dtype != _TYPES[kind] or found.shape != shape:
            raise BadInput(
                f"the policy's array '{name}' is {found.dtype} {list(found.shape)}, "
                f"expected {np.dtype(_TYPES[kind])} {list(shape)}: it is of other behaviors, parameters or another release; "
                "train it again"
            )
        if kind == "f" and not np.isfinite(found).all():
            raise BadInput(f"the policy's array '{name}' has a value that is not finite")


def check_range(arrays: Mapping[str, NDArray[Any]], name: str, low: float, high: float) -> None:
    """Raises BadInput where a value of an array is outside of [low, high]."""
    found = arrays[name]
    if found.size and not low <= found.min() <= found.max() <= high:
        raise BadInput(
            f"the policy's array '{name}' goes from {found.min():g} to {found.max():g}, outside of [{low:g}, {high:g}]"
        )


def rows_of(arrays: Mapping[str, NDArray[Any]], name: str) -> int:
    """Length of an array; 0 where it is missing or has none, which `check_arrays` then says."""
    return len(arrays[name]) if name in arrays and arrays[name].ndim else 0


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
