"""A controller of one's own: what it may select, for any number of behaviors, and what is said of anything else."""

from __future__ import annotations

from math import inf, nan
from typing import Any

import numpy as np
import pytest
from fbql_common.core.errors import BadInput
from fbql_common.core.types import Phase
from fbql_fusion.core.controllers.guarded import GuardedLearner, guard

HUGE = 10**400
"""A whole number beyond the largest float."""


class Fixed:
    """Selects always the same, and notes its calls."""

    def __init__(self, selection: Any) -> None:
        self.selection = selection
        self.calls: list[Any] = []

    def begin_episode(self, phase: Phase) -> None:
        self.calls.append(phase)

    def select(self, *given: Any) -> Any:
        self.calls.append(given)
        return self.selection


def selected(selection: Any, behaviors: int) -> Any:
    return guard(Fixed(selection), "mine", "", behaviors).select("moment", (0,) * behaviors, [])


@pytest.mark.parametrize("n", [1, 2, 3])
def test_a_driver_is_a_behavior_or_minus_1_and_numbers_are_finite_one_per_behavior(n: int) -> None:
    ones = (1.0,) * n
    for driver in (-1, 0, n - 1, np.int64(n - 1)):
        assert selected((ones, driver, (), ()), n) == (ones, int(driver), (), ())
    assert selected([[1] * n, 0, [2] * n, np.full(n, 3.0)], n) == (ones, 0, (2.0,) * n, (3.0,) * n)
    for driver in (-2, n, 0.0, None):
        with pytest.raises(BadInput, match=r"controller 'mine': 'select' returns driver .*; expected the index"):
            selected((ones, driver, (), ()), n)
    for wrong in (nan, inf, -inf, HUGE, "1", None, 1j):
        numbers = (*ones[1:], wrong)
        with pytest.raises(BadInput, match=f"returns weights .* expected {n} finite numbers$"):
            selected((numbers, 0, (), ()), n)
        with pytest.raises(BadInput, match=f"returns q .* expected {n} finite numbers or none"):
            selected((ones, 0, numbers, ()), n)
        with pytest.raises(BadInput, match=f"returns learned weights .* expected {n} finite numbers or none"):
            selected((ones, 0, (), numbers), n)
    for count in (0, n - 1, n + 1):
        with pytest.raises(BadInput, match="returns weights"):
            selected(((1.0,) * count, 0, (), ()), n)
    for unlike in ((ones, 0, ()), (ones, 0, (), (), ()), {}, None):
        with pytest.raises(BadInput, match=r"expected .weights, driver, q, learned weights."):
            selected(unlike, n)


def test_every_call_is_forwarded() -> None:
    fixed = Fixed(((1.0,), 0, (), ()))
    guarded = guard(fixed, "mine", "", 1)
    guarded.begin_episode(Phase.GUIDED)
    guarded.select("moment", (3,), ["answer"])  # pyright: ignore[reportArgumentType]
    assert fixed.calls == [Phase.GUIDED, ("moment", (3,), ["answer"])]


def test_one_that_has_a_learner_s_methods_is_a_learner_of_its_kind_and_one_with_some_of_them_is_refused() -> None:
    class Learns(Fixed):
        kind = "own kind"

        def learn(self, transition: Any) -> None:
            self.calls.append(transition)

        def to_arrays(self) -> dict[str, Any]:
            return {"a": np.zeros(2)}

        def load_arrays(self, arrays: Any) -> None:
            self.calls.append(arrays)

    own = Learns(None)
    guarded = guard(own, "mine", "", 1)
    assert isinstance(guarded, GuardedLearner)
    assert guarded.kind == "own kind"
    guarded.learn("transition")  # pyright: ignore[reportArgumentType]
    assert guarded.to_arrays()["a"].tolist() == [0.0, 0.0]
    guarded.load_arrays({})
    assert own.calls == ["transition", {}]
    assert not isinstance(guard(Fixed(None), "mine", "", 1), GuardedLearner)
    del Learns.load_arrays
    with pytest.raises(BadInput, match="a Learns has no method 'load_arrays'; one that learns has learn, to_arrays"):
        guard(own, "mine", "", 1)
