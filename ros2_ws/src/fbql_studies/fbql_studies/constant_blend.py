"""The constant blend: each behavior's output weighted by a number that is always the same, the best there is for its trees."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

from fbql_behaviors.core.behavior import Behavior
from fbql_common.core.types import World
from fbql_fusion.core.blending import blend
from fbql_sim.core.world_loop import WorldLoop

from fbql_studies.runner.study import Result
from fbql_studies.training import driven
from fbql_studies.tuning import TUNING_SEED, Rounds, cheapest

CONSTANT = "constant blend"
GRID = 5
"""Constant weights are multiples of 1 / GRID."""

BLEND_ROUNDS: Rounds = ((20, 6), (100, 1))
"""Less than the thresholds have: a blend costs several times as many steps for a goal, and is told apart by fewer."""

Weights = tuple[float, ...]


def grid(n: int) -> list[Weights]:
    """All weights of n behaviors that are multiples of 1 / GRID and sum to 1."""
    return [tuple(part / GRID for part in parts) for parts in product(range(GRID + 1), repeat=n) if sum(parts) == GRID]


def blend_played(weights: Weights, behaviors: Sequence[Behavior], loop: WorldLoop, seed: int, episodes: int) -> Result:
    """The figures of these weights on so many episodes of a run seed."""
    answers = [behavior.answer for behavior in behaviors]

    def drive(world: World) -> tuple[float, float]:
        command = blend(weights, [answer(world) for answer in answers])
        return command.left_rad_s, command.right_rad_s

    return driven(drive, loop, seed, episodes)


def best_blend(behaviors: Sequence[Behavior], loop: WorldLoop) -> Weights:
    """The constant weights with the least cost/goal for a tree set, on the episodes that Subsumption is tuned on as well."""

    def cost(weights: Weights, episodes: int) -> float:
        found = blend_played(weights, behaviors, loop, TUNING_SEED, episodes)
        return found["steps"] / found["goals"] if found["goals"] else float("inf")

    return cheapest(grid(len(behaviors)), cost, BLEND_ROUNDS)
