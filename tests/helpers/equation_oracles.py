"""Slow oracles in plain Python for the learners' equations."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import exp

from hypothesis import strategies as st


def preference_lists(low: int = 1) -> st.SearchStrategy[list[float]]:
    """Preferences of at least `low` behaviors."""
    return st.lists(st.floats(-3, 3), min_size=low, max_size=5)


def literal_softmax(h: Sequence[float]) -> list[float]:
    """Eq. 10."""
    return [exp(x) / sum(exp(y) for y in h) for x in h]


def gradient(value: Callable[[list[float]], float], at: Sequence[float]) -> list[float]:
    """By central differences."""
    step = 1e-5
    found: list[float] = []
    for i in range(len(at)):
        up, down = list(at), list(at)
        up[i] += step
        down[i] -= step
        found.append((value(up) - value(down)) / (2 * step))
    return found
