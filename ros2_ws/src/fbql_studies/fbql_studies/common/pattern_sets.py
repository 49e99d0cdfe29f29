"""Patterns of a demonstration seed, and the trees that induction makes from them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

from fbql.demonstrations.instruct import instruct
from fbql_behaviors.core.induction import InductionParameters, induce
from fbql_behaviors.core.observation import OBSERVATIONS
from fbql_behaviors.core.patterns import Patterns, patterns_of
from fbql_behaviors.core.recipes import RECIPES, Recipe
from fbql_behaviors.core.tree import Tree

OBJECTIVES = ("weighted", "printed")
HELD_OUT_SEEDS = 100_000
"""Added to a demonstration seed to get the seed of the demonstrations that are held out."""


@dataclass(frozen=True)
class PatternSet:
    """The input of a method: a behavior, its recipe, and the patterns of one demonstration seed."""

    behavior: str
    seed: int

    @property
    def recipe(self) -> Recipe:
        """The behavior's recipe."""
        return RECIPES[self.behavior]

    @cached_property
    def training(self) -> Patterns:
        """The patterns to learn from, at most 1000: see the recipe."""
        return self._recorded(self.seed, self.recipe.every, self.recipe.patterns)

    @cached_property
    def held_out(self) -> Patterns:
        """Patterns of as many other demonstrations, every step of them."""
        return self._recorded(self.seed + HELD_OUT_SEEDS, 1, None)

    @cached_property
    def equal_leaves(self) -> int:
        """The leaf count of the exact tree of the weighted objective, which other methods may have as well."""
        return induced(self, "weighted", method="dp").tree.leaf_count

    def prepared(self) -> PatternSet:
        """Itself, with every lazy property computed."""
        _ = self.training, self.held_out, self.equal_leaves
        return self

    def _recorded(self, seed: int, every: int, count: int | None) -> Patterns:
        demonstrations = instruct(self.behavior, seed, self.recipe.demonstrations, self.recipe.steps)
        return patterns_of(demonstrations, OBSERVATIONS[self.behavior], every, count)


class Grown(NamedTuple):
    """A tree, and the root's value according to its method [nat]; None if it has no such value."""

    tree: Tree
    belief: float | None = None


def setting(patterns: PatternSet, objective: str, **changes: object) -> InductionParameters:
    """The recipe's parameters for an objective, with changes."""
    usual = patterns.recipe.printed if objective == "printed" else patterns.recipe.induction
    return replace(usual, **changes)  # type: ignore[arg-type]  # names of fields


def induced(patterns: PatternSet, objective: str, **changes: object) -> Grown:
    """Our induction by the recipe, with changes."""
    found = induce(patterns.behavior, patterns.training, setting(patterns, objective, **changes), patterns.seed)
    return Grown(found.tree, found.value)
