"""A random generator's state as numbers, so that a training goes on exactly where it was left."""

from __future__ import annotations

import numpy as np
from fbql_common.core.errors import BadInput
from numpy.typing import NDArray

_LOW = (1 << 64) - 1


def generator_state(generator: np.random.Generator) -> NDArray[np.uint64]:
    """The state of a PCG64 generator: state and increment, high and low halves, and the spare half draw, [6]."""
    state = generator.bit_generator.state
    position, increment = state["state"]["state"], state["state"]["inc"]
    words = [position >> 64, position & _LOW, increment >> 64, increment & _LOW, state["has_uint32"], state["uinteger"]]
    return np.array(words, dtype=np.uint64)


def set_generator_state(generator: np.random.Generator, words: NDArray[np.uint64]) -> None:
    """Takes over what `generator_state` gave. Raises BadInput where it is no such state."""
    high, low, increment_high, increment_low, has_spare, spare = [int(word) for word in words]
    if not increment_low & 1 or has_spare > 1 or spare >> 32:
        raise BadInput("the policy's array 'generator' is no state of a generator")
    generator.bit_generator.state = {
        "bit_generator": "PCG64",
        "state": {"state": high << 64 | low, "inc": increment_high << 64 | increment_low},
        "has_uint32": has_spare,
        "uinteger": spare,
    }
