"""The arrays of a policy: validation after reading, and a random generator's state as numbers."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from fbql_common.core.errors import BadInput
from numpy.typing import NDArray

_LOW = (1 << 64) - 1
_TYPES = {"l": np.int32, "i": np.int64, "u": np.uint64, "s": np.float32, "f": np.float64, "b": np.bool_}


def check_arrays(arrays: Mapping[str, NDArray[Any]], expected: Mapping[str, tuple[str, tuple[int, ...]]]) -> None:
    """Raises BadInput where an array is missing, of another kind or shape, or has a value that is not finite.

    Args:
        expected: for each array its kind ("l" int32, "i" int64, "u" uint64, "s" float32, "f" float64 or "b" bool) and its shape.
    """
    for name, (kind, shape) in expected.items():
        if name not in arrays:
            raise BadInput(f"the policy has no array '{name}'")
        found = arrays[name]
        if found.dtype != _TYPES[kind] or found.shape != shape:
            raise BadInput(
                f"the policy's array '{name}' is {found.dtype} {list(found.shape)}, "
                f"expected {np.dtype(_TYPES[kind])} {list(shape)}: it belongs to other behaviors, parameters or another release; "
                "train it again"
            )
        if kind in "sf" and not np.isfinite(found).all():
            raise BadInput(f"the policy's array '{name}' has a value that is not finite")


def check_range(arrays: Mapping[str, NDArray[Any]], name: str, low: float, high: float) -> None:
    """Raises BadInput where a value of an array is outside of [low, high]."""
    found = arrays[name]
    if found.size and not low <= found.min() <= found.max() <= high:
        raise BadInput(
            f"the policy's array '{name}' goes from {found.min():g} to {found.max():g}, outside of [{low:g}, {high:g}]"
        )


def rows_of(arrays: Mapping[str, NDArray[Any]], name: str) -> int:
    """Length of an array; 0 where it is missing or has no dimension, which `check_arrays` then reports."""
    return len(arrays[name]) if name in arrays and arrays[name].ndim else 0


def generator_state(generator: np.random.Generator) -> NDArray[np.uint64]:
    """The state of a PCG64 generator: state and increment, high and low halves, and the spare half draw, [6]."""
    state = generator.bit_generator.state
    position, increment = state["state"]["state"], state["state"]["inc"]
    words = [position >> 64, position & _LOW, increment >> 64, increment & _LOW, state["has_uint32"], state["uinteger"]]
    return np.array(words, dtype=np.uint64)


def set_generator_state(generator: np.random.Generator, words: NDArray[np.uint64]) -> None:
    """Restores what `generator_state` returned, so that a training resumes exactly. Raises BadInput if it is not a
    state."""
    high, low, increment_high, increment_low, has_spare, spare = [int(word) for word in words]
    if not increment_low & 1 or has_spare > 1 or spare >> 32:
        raise BadInput("the policy's array 'generator' is not the state of a generator")
    generator.bit_generator.state = {
        "bit_generator": "PCG64",
        "state": {"state": high << 64 | low, "inc": increment_high << 64 | increment_low},
        "has_uint32": has_spare,
        "uinteger": spare,
    }
