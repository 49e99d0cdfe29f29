"""Joint states in which eq. 6 finds no argmax."""

from __future__ import annotations

import numpy as np
import pytest
from fbql_fusion.core.equations import tied


def test_a_joint_state_is_tied_where_all_q_are_equal_to_the_last_bit() -> None:
    q = np.array([[0.0, 0.0, 0.0], [1.0, 1.0, np.nextafter(1.0, 2.0)], [2.5, 2.5, 2.5], [1.0, 1.0, 0.0]])
    assert tied(q) == 2
    assert tied(q[:0]) == 0


@pytest.mark.parametrize("n", [1, 2, 8])
def test_one_behavior_is_always_tied_and_the_number_of_behaviors_stands_nowhere(n: int) -> None:
    assert tied([[0.5] * n]) == 1
    assert tied([[0.5] * (n - 1) + [0.25]]) == (n == 1)
