"""The search for the constants of the scripted law: the cross-entropy method.

Source: Rubinstein, The Cross-Entropy Method for Combinatorial and Continuous Optimization (1999).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import astuple
from typing import NamedTuple

import numpy as np
from fbql_sim.core.scripted_law import UNTUNED, LawConstants
from numpy.typing import NDArray

ELITE_SHARE = 0.2
"""Share of a generation that the next one is drawn around."""
FIRST_DEVIATION = 0.5
"""Standard deviation of the logarithm of each constant in the first generation: a factor of 1.6 either way."""
LEAST_DEVIATION = 0.02
"""Each generation keeps at least this one, so that the search does not stop at what a few lucky episodes favored."""

Cost = Callable[[LawConstants, int], float]
"""(constants, generation) -> cost, on the episodes of that generation."""


class Search(NamedTuple):
    """What a search found."""

    constants: LawConstants
    """The centre of the last elite."""
    best: list[float]
    """The least cost of each generation, on that generation's episodes."""


def search(cost: Cost, generations: int, population: int, rng: np.random.Generator) -> Search:
    """Tunes all constants at once, as their logarithms, beginning around those set by hand.

    A generation is drawn from a normal distribution whose mean and deviations are those of the last one's elite. Its first
    member is that mean.
    """
    mean: NDArray[np.float64] = np.log(astuple(UNTUNED))
    deviation = np.full(len(mean), FIRST_DEVIATION)
    elite = max(round(population * ELITE_SHARE), 1)
    best: list[float] = []
    for generation in range(generations):
        drawn = mean + deviation * rng.standard_normal((population, len(mean)))
        drawn[0] = mean
        costs = [cost(constants_of(each), generation) for each in drawn]
        chosen = drawn[np.argsort(costs, kind="stable")[:elite]]
        mean, deviation = chosen.mean(axis=0), np.maximum(chosen.std(axis=0), LEAST_DEVIATION)
        best.append(min(costs))
    return Search(constants_of(mean), best)


def constants_of(logarithms: NDArray[np.float64]) -> LawConstants:
    """The constants, rounded to four digits: more would not be reproducible by eye, and do not matter."""
    return LawConstants(*(float(f"{x:.4g}") for x in np.exp(logarithms)))
