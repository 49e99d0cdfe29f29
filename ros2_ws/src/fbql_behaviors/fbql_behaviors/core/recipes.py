"""How the tree of each behavior is made: the demonstrations, the patterns taken from them, the induction.

One setting per behavior, the same for every seed; docs/deviations.md gives the reasons.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from fbql_behaviors.core.induction import InductionParameters

PRINTED = InductionParameters(objective="printed", split_cost=-0.1, min_range=1 / 16)


@dataclass(frozen=True)
class Recipe:
    """How the tree of one behavior is made."""

    induction: InductionParameters = field(default_factory=InductionParameters)
    """The induction of the shipped tree."""
    printed: InductionParameters = PRINTED
    """The induction with the objective as printed, which needs other limits to make a tree of the same size."""
    demonstrations: int = 100
    """Number of demonstrations. Many short ones: long ones stay where the law leads, and leave large angles uncovered."""
    steps: int = 60
    """Most steps of a demonstration; it also ends when its episode ends."""
    every: int = 6
    """Steps from one pattern to the next: neighboring steps are nearly the same."""
    patterns: int = 1000
    """Most patterns; the paper uses as many."""


RECIPES = {
    "ball_seeking": Recipe(InductionParameters(split_cost=-0.006)),
    "wall_avoiding": Recipe(InductionParameters(split_cost=-0.025), replace(PRINTED, min_patterns=160)),
    "approaching": Recipe(InductionParameters(split_cost=-0.0115), replace(PRINTED, split_cost=-0.2, min_patterns=17)),
}


def recipe_of(behavior: str) -> Recipe:
    """The recipe of a behavior, or the default one if it has none."""
    return RECIPES.get(behavior, Recipe())
