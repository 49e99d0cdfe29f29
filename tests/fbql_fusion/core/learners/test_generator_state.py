"""The generator's state as an array: a training resumes with the very next draw."""

from __future__ import annotations

import numpy as np
import pytest
from fbql_common.core.errors import BadInput
from fbql_fusion.core.learners.policy_arrays import generator_state, set_generator_state


def test_a_restored_generator_draws_what_the_other_one_draws_next() -> None:
    generator, other = np.random.default_rng(3), np.random.default_rng(4)
    for used in range(3):
        generator.integers(2**32, size=used, dtype=np.uint32)  # an odd number leaves half a draw
        set_generator_state(other, generator_state(generator))
        assert other.bit_generator.state == generator.bit_generator.state
        assert other.random(5).tolist() == generator.random(5).tolist()


@pytest.mark.parametrize(("place", "value"), [(3, 2), (4, 2), (5, 1 << 32)])
def test_what_is_no_state_is_refused(place: int, value: int) -> None:
    words = generator_state(np.random.default_rng(3))
    words[place] = value
    with pytest.raises(BadInput, match="not the state of a generator"):
        set_generator_state(np.random.default_rng(4), words)
