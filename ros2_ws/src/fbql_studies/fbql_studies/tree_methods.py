"""The ways to make a tree that the study of trees compares, each a function of a behavior's patterns.

Methods are grouped in families, because a worker makes and plays a family at a time.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any, NamedTuple

from fbql.demonstrations.instruct import instruct
from fbql_behaviors.cart import grow_cart
from fbql_behaviors.core.induction import InductionParameters, induce
from fbql_behaviors.core.observation import OBSERVATIONS
from fbql_behaviors.core.patterns import Patterns, patterns_of
from fbql_behaviors.core.quantizer import levels_of_classes, rad_s_of
from fbql_behaviors.core.recipes import RECIPES, Recipe
from fbql_behaviors.core.tree import Leaf, Tree
from fbql_behaviors.sklearn_trees import from_sklearn

from fbql_studies.optimal_trees import optimal_tree
from fbql_studies.runner.study import MEASURED, Result

TRIALS = (5, 20, 50, 200, 1000)
OBJECTIVES = ("weighted", "printed")
HELD_OUT_SEEDS = 100_000
"""What is added to a demonstration seed to get that of the demonstrations that are held out."""
FIRST_SEED = 1001
"""The first demonstration seed, and run seed of play."""
KNOWN_SEEDS = range(1, 9)
"""Demonstration seeds that the recipes were chosen on."""
BANDS = {"ball_seeking": (95, 135), "wall_avoiding": (7, 15), "approaching": (30, 42)}
"""Leaf counts round the paper's 122, 11 and 37."""
SHIPPED = "weighted rl 50"
"""The method of the trees that ship, which the others are compared with."""


@dataclass(frozen=True)
class Lesson:
    """What a method gets: a behavior, its recipe, and the patterns of one demonstration seed."""

    behavior: str
    seed: int

    @property
    def recipe(self) -> Recipe:
        """The behavior's setting."""
        return RECIPES[self.behavior]

    @cached_property
    def patterns(self) -> Patterns:
        """The patterns to learn from: 1000 at most, as the recipe says."""
        return self._shown(self.seed, self.recipe.every, self.recipe.patterns)

    @cached_property
    def held_out(self) -> Patterns:
        """Patterns of as many other demonstrations, every step of them."""
        return self._shown(self.seed + HELD_OUT_SEEDS, 1, None)

    @cached_property
    def equal_leaves(self) -> int:
        """The leaves of the exact tree of the weighted objective: what other methods may have, too."""
        return induced(self, "weighted", method="dp").tree.leaf_count

    def prepared(self) -> Lesson:
        """This, with everything looked up that a method may ask for."""
        _ = self.patterns, self.held_out, self.equal_leaves
        return self

    def _shown(self, seed: int, every: int, count: int | None) -> Patterns:
        demonstrations = instruct(self.behavior, seed, self.recipe.demonstrations, self.recipe.steps)
        return patterns_of(demonstrations, OBSERVATIONS[self.behavior], every, count)


class Grown(NamedTuple):
    """A tree, and what its method believes the root to be worth [nat]; None where it has no such belief."""

    tree: Tree
    belief: float | None = None


Method = Callable[[Lesson], Grown | None]
"""None: the method did not finish."""


def setting(lesson: Lesson, objective: str, **changes: object) -> InductionParameters:
    """The recipe's parameters for an objective, with changes."""
    usual = lesson.recipe.printed if objective == "printed" else lesson.recipe.induction
    return replace(usual, **changes)  # type: ignore[arg-type]  # names of fields


def induced(lesson: Lesson, objective: str, **changes: object) -> Grown:
    """Our induction by the recipe, with changes."""
    found = induce(lesson.behavior, lesson.patterns, setting(lesson, objective, **changes), lesson.seed)
    return Grown(found.tree, found.value)


def within_printed_limits(lesson: Lesson) -> Grown:
    """The weighted objective with the stop criteria of the printed one: what the objective alone makes of it."""
    limits = lesson.recipe.printed
    return induced(lesson, "weighted", method="dp", min_range=limits.min_range, min_patterns=limits.min_patterns)


def cart(lesson: Lesson, leaves: int | None) -> Grown:
    """CART by squared error of both wheels' levels, best split first; None: cross-validation chooses the leaves."""
    return Grown(grow_cart(lesson.behavior, lesson.patterns, lesson.seed, leaves).tree)


def cart_by_entropy(lesson: Lesson, leaves: int) -> Grown:
    """CART by the entropy of the classes (eq. 2), best split first, with leaves that answer the mean, as ours do."""
    from sklearn.tree import DecisionTreeClassifier

    model = DecisionTreeClassifier(criterion="entropy", max_leaf_nodes=leaves, random_state=lesson.seed)
    model.fit(lesson.patterns.x, lesson.patterns.wheel_class)
    return Grown(with_leaf_means(from_sklearn(model, lesson.behavior, lesson.patterns.features), lesson.patterns))


def optimal(lesson: Lesson, depth: int, leaves: int) -> Grown | None:
    """The tree of least squared error on the patterns."""
    tree = optimal_tree(lesson.behavior, lesson.patterns, depth, leaves)
    return None if tree is None else Grown(with_leaf_means(tree, lesson.patterns))


def with_leaf_means(tree: Tree, patterns: Patterns) -> Tree:
    """The same partition; each leaf answers the mean of its patterns' quantized wheel velocities."""
    levels = levels_of_classes(patterns.wheel_class)
    leaf_ids = tree.leaf_ids(patterns.x)
    leaves: list[Leaf] = []
    for leaf_id, leaf in enumerate(tree.leaves):
        inside = levels[leaf_ids == leaf_id]
        if len(inside):
            left, right = inside.mean(axis=0).tolist()
            leaf = Leaf(rad_s_of(left), rad_s_of(right), len(inside))
        leaves.append(leaf)
    return replace(tree, leaves=tuple(leaves))


def _of_objective(objective: str) -> dict[str, Method]:
    by_trials = {f"{objective} rl {n}": partial(induced, objective=objective, trials=n) for n in TRIALS}
    return {**by_trials, f"{objective} dp": partial(induced, objective=objective, method="dp")}


def _from_0(objective: str) -> dict[str, Method]:
    """Q begins at 0; only chance explores: all of the first trial's actions are random, none of the last one's."""
    usual = partial(induced, objective=objective, optimism=0.0, epsilon_start=1.0, epsilon_end=0.0)
    return {f"{objective} rl {n}, Q from 0": partial(usual, trials=n) for n in TRIALS}


FAMILIES: Mapping[str, Mapping[str, Method]] = {
    "weighted": _of_objective("weighted"),
    "printed": _of_objective("printed"),
    "weighted-from-0": _from_0("weighted"),
    "printed-from-0": _from_0("printed"),
    "others": {
        "weighted dp, printed's limits": within_printed_limits,
        "cart": lambda lesson: cart(lesson, lesson.equal_leaves),
        "cart by entropy": lambda lesson: cart_by_entropy(lesson, lesson.equal_leaves),
        "cart, cross-validated": lambda lesson: cart(lesson, None),
        "one leaf": lambda lesson: Grown(induced(lesson, "weighted", method="dp", max_entropy=10.0).tree),
    },
    "optimal": {
        "optimal, 8 leaves": lambda lesson: optimal(lesson, 3, 8),
        "optimal": lambda lesson: optimal(lesson, 5, lesson.equal_leaves),
    },
}
"""Family -> method -> what makes it. `optimal` needs pystreed."""


def methods_of(results: Mapping[str, Result]) -> dict[str, dict[int, dict[str, Any]]]:
    """Method -> seed -> its trees, play and seconds, in the order of FAMILIES."""
    found: dict[str, dict[int, dict[str, Any]]] = {method: {} for family in FAMILIES.values() for method in family}
    for key, result in results.items():
        for method, each in result.get("methods", {}).items():
            found[method][int(key.split("-")[0])] = {**each, "seconds": result[MEASURED]["seconds"][method]}
    return {method: by_seed for method, by_seed in found.items() if by_seed}
