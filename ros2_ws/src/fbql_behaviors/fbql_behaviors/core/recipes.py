"""How the tree of each behavior is made: how much is demonstrated, what is taken from it, how it is induced.

One setting per behavior, the same for every seed; docs/deviations.md says why these.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from fbql_behaviors.core.induction import InductionParameters

PRINTED = InductionParameters(objective="printed", split_cost=-0.1, min_range=1 / 16)


@dataclass(frozen=True)
class Recipe:
    """A behavior's setting."""

    induction: InductionParameters = field(default_factory=InductionParameters)
    """The induction of the tree that ships."""
    printed: InductionParameters = PRINTED
    """The induction with the objective as printed, which needs other limits for a tree of the same size."""
    demonstrations: int = 100
    """Many short ones: long ones spend their time where the law leads, and leave large angles uncovered."""
    steps: int = 60
    """Steps of a demonstration at most; an episode that ends, ends it."""
    every: int = 6
    """Every so many steps a pattern is taken: neighbouring steps are nearly the same."""
    patterns: int = 1000
    """Patterns at most, as many as the paper's."""


RECIPES = {
    "ball_seeking": Recipe(InductionParameters(split_cost=-0.006)),
    "wall_avoiding": Recipe(InductionParameters(split_cost=-0.025), replace(PRINTED, min_patterns=160)),
    "approaching": Recipe(InductionParameters(split_cost=-0.0115), replace(PRINTED, split_cost=-0.2, min_patterns=17)),
}


def recipe_of(behavior: str) -> Recipe:
    """The setting of a behavior; the general one for a behavior without its own."""
    return RECIPES.get(behavior, Recipe())
