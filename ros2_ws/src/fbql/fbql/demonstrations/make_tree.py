"""A behavior's tree from its recipe and a demonstration seed."""

from __future__ import annotations

from fbql_behaviors.core.induction import Induced, induce
from fbql_behaviors.core.observation import OBSERVATIONS
from fbql_behaviors.core.patterns import patterns_of
from fbql_behaviors.core.recipes import RECIPES

from fbql.demonstrations.instruct import instruct

DEMONSTRATION_SEED = 1
INDUCTION_SEED = 1


def make_tree(behavior: str, demonstration_seed: int = DEMONSTRATION_SEED) -> Induced:
    """A behavior's tree by its recipe; with the default seed the one that ships."""
    recipe = RECIPES[behavior]
    demonstrations = instruct(behavior, demonstration_seed, recipe.demonstrations, recipe.steps)
    patterns = patterns_of(demonstrations, OBSERVATIONS[behavior], recipe.every, recipe.patterns)
    return induce(behavior, patterns, recipe.induction, INDUCTION_SEED)
