"""A behavior's tree from demonstrations: a request goes in, and the tree with its figures comes out.

The command `induce` and `fbql.induce` both use it; `make_tree` makes a tree by its recipe, such as the shipped ones.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from time import monotonic
from typing import Any

from fbql_behaviors.cart import grow_cart, scikit_learn
from fbql_behaviors.core.evaluation import cross_validated_rmse
from fbql_behaviors.core.induction import Induced, InductionParameters, induce
from fbql_behaviors.core.observation import OBSERVATIONS, Law, observation_of
from fbql_behaviors.core.patterns import Demonstration, Patterns, patterns_of
from fbql_behaviors.core.recipes import RECIPES, Recipe, recipe_of
from fbql_behaviors.core.tree import Tree
from fbql_behaviors.core.tree_value import tree_value
from fbql_common.core.errors import BadInput
from fbql_common.core.parameters import check, types_of

from fbql.demonstrations.instruct import instruct

DEMONSTRATION_SEED = 1
INDUCTION_SEED = 1
CART = "cart"
_OF_TRIALS = ("trials", "learning_rate", "optimism", "epsilon_start", "epsilon_end", "update")
_OF_SPLITS = ("min_range", "min_patterns", "min_half_patterns", "max_entropy")


@dataclass(frozen=True)
class InductionRequest:
    """How to induce a tree. Created by `request_of`, which checks it."""

    behavior: str
    recipe: Recipe
    method: str
    """rl, dp or cart."""
    seed: int = INDUCTION_SEED
    leaves: int | None = None
    """Number of leaves of cart; None: chosen by cross-validation."""

    @property
    def parameters(self) -> InductionParameters:
        """The parameters of the induction."""
        return self.recipe.induction


@dataclass(frozen=True)
class InducedTree:
    """A tree, whatever the method, and how it was found."""

    tree: Tree
    value: float
    """Value of the root [nat]: as learned by rl, exact for the others."""
    curve: Sequence[float] = ()
    """Value of the root after each trial of rl."""
    tried: Mapping[int, float] = field(default_factory=dict[int, float])
    """Held-out error [levels] by number of leaves, where cart chose its size."""
    rmse_levels: float | None = None
    """Cross-validated error of the wheel velocities [levels]; None with fewer than two demonstrations."""
    seconds: float = 0.0
    """Time that the induction took [s], without the cross-validation."""


def request_of(
    behavior: str,
    recipe: Recipe | None = None,
    *,
    method: str | None = None,
    objective: str | None = None,
    seed: int = INDUCTION_SEED,
    every: int | None = None,
    patterns: int | None = None,
    leaves: int | None = None,
    **parameters: Any,
) -> InductionRequest:
    """The request for a behavior's tree: its recipe, overridden by the given arguments.

    Args:
        recipe: by default that of the registered behavior.
        method: rl (trials), dp (exact) or cart (scikit-learn).
        objective: what a tree is worth: weighted, or as printed in the paper.
        every: take every n-th step of a demonstration as a pattern.
        patterns: take at most this many patterns.
        leaves: number of leaves; for cart only.
        parameters: other fields of `InductionParameters`.

    Raises:
        BadInput: an unknown behavior or parameter, or a value out of range.
    """
    if recipe is None:
        observation_of(behavior)
        recipe = recipe_of(behavior)
    is_cart = method == CART
    if is_cart:
        scikit_learn()  # refused here, before anything takes long
    elif leaves is not None:
        raise BadInput(
            "leaves applies only to method cart; the other methods choose the number themselves (split_cost)"
        )
    given = {"method": None if is_cart else method, "objective": objective, **parameters}
    unknown = sorted(given.keys() - types_of(InductionParameters).keys())
    if unknown:
        raise BadInput(f"induction has no parameter '{unknown[0]}'; it has {', '.join(types_of(InductionParameters))}")
    usual = recipe.printed if objective == "printed" else recipe.induction
    induction = replace(usual, **{name: value for name, value in given.items() if value is not None})
    check(induction, "induction")
    for name, value, low in (("every", every, 1), ("patterns", patterns, 1), ("seed", seed, 0)):
        if value is not None and value < low:
            raise BadInput(f"{name} is {value}; it must be at least {low}")
    recipe = replace(recipe, induction=induction, every=every or recipe.every, patterns=patterns or recipe.patterns)
    return InductionRequest(behavior, recipe, CART if is_cart else induction.method, seed, leaves)


def unused_parameters(method: str) -> tuple[str, ...]:
    """The parameters that have no effect with a method."""
    return {"dp": (*_OF_TRIALS, "seed"), CART: (*_OF_SPLITS, *_OF_TRIALS)}.get(method, ())


def instructed(request: InductionRequest, seed: int = DEMONSTRATION_SEED) -> list[Demonstration]:
    """Demonstrations by the behavior's scripted instructor, as many as its recipe says. Raises BadInput."""
    return instruct(request.behavior, seed, request.recipe.demonstrations, request.recipe.steps)


def patterns_for(request: InductionRequest, demonstrations: Sequence[Demonstration]) -> Patterns:
    """The patterns that are taken from demonstrations. Raises BadInput."""
    recipe = request.recipe
    return patterns_of(demonstrations, observation_of(request.behavior), recipe.every, recipe.patterns)


def induced_tree(request: InductionRequest, patterns: Patterns) -> InducedTree:
    """Induces the tree, and cross-validates the method by demonstration."""
    begun_s = monotonic()
    made = _grow(request, patterns)
    seconds = monotonic() - begun_s
    rmse = cross_validated_rmse(patterns, lambda part: _grow(request, part).tree)
    return replace(made, rmse_levels=rmse, seconds=seconds)


def optimum_of(request: InductionRequest, patterns: Patterns) -> float:
    """The value of the best tree of half-splits [nat], by dynamic programming."""
    return induce(request.behavior, patterns, replace(request.parameters, method="dp"), request.seed).value


def _grow(request: InductionRequest, patterns: Patterns) -> InducedTree:
    if request.method == CART:
        cart = grow_cart(request.behavior, patterns, request.seed, request.leaves)
        return InducedTree(cart.tree, tree_value(cart.tree, patterns, request.parameters), tried=cart.tried)
    tree, value, curve = induce(request.behavior, patterns, request.parameters, request.seed)
    return InducedTree(tree, value, curve)


def make_tree(behavior: str, demonstration_seed: int = DEMONSTRATION_SEED, instructor: Law | None = None) -> Induced:
    """A behavior's tree by its recipe; with the default seed and its own instructor the shipped one."""
    recipe = RECIPES[behavior]
    demonstrations = instruct(behavior, demonstration_seed, recipe.demonstrations, recipe.steps, law=instructor)
    patterns = patterns_of(demonstrations, OBSERVATIONS[behavior], recipe.every, recipe.patterns)
    return induce(behavior, patterns, recipe.induction, INDUCTION_SEED)
