"""Controls that are tuned for each tree set, on episodes that no evaluation uses: Subsumption's thresholds,
constant weights."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import product

from fbql_behaviors.core.behavior import Behavior
from fbql_common.core.field import WHEELS
from fbql_common.core.types import World
from fbql_fusion.core.blending import blend
from fbql_fusion.core.parameters import FusionParameters
from fbql_sim.core.world_loop import WorldLoop

from fbql_studies.common.play import Score, driven, score_of
from fbql_studies.runner.study import Result

TUNING_SEED = 11
Rounds = Sequence[tuple[int, int]]
"""Training episodes that each candidate plays, and how many candidates are left after them."""
TUNING_ROUNDS: Rounds = ((30, 12), (150, 4), (500, 1))
WALL_M = (0.0, 0.06, 0.07, 0.08, 0.10, 0.12)
APPROACH_RAD = (0.0, 0.05, 0.1, 0.15, 0.3, 1.0)
GRID = 5
"""Constant weights are multiples of 1 / GRID."""
BLEND_ROUNDS: Rounds = ((20, 6), (100, 1))
"""Fewer than for thresholds: a blend takes several times as many steps per goal, and differences show sooner."""

Weights = tuple[float, ...]


def cheapest[Candidate](
    candidates: Sequence[Candidate], cost: Callable[[Candidate, int], float], rounds: Rounds
) -> Candidate:
    """The candidate with the least cost(candidate, episodes); the first of equal ones.

    All candidates play a few episodes, the best of them many: a deadlock that happens once in fifty episodes decides a
        candidate's cost, and few episodes don't show it. Chosen on 30 alone, a pair of thresholds had 6 timeouts in 100
    fresh episodes.
    """
    left = list(candidates)
    for episodes, kept in rounds:
        if len(left) > kept:
            costs = {candidate: cost(candidate, episodes) for candidate in left}
            left = sorted(left, key=lambda candidate: costs[candidate])[:kept]
    return left[0]


def retuned(behaviors: Sequence[Behavior], loop: WorldLoop) -> tuple[float, float]:
    """Subsumption's thresholds (wall [m], psi [rad]) with the least cost/goal for a tree set, on training episodes."""
    pairs = list(product(WALL_M, APPROACH_RAD))
    return cheapest(pairs, lambda pair, episodes: _cost_with(pair, behaviors, loop, episodes), TUNING_ROUNDS)


def _cost_with(thresholds: tuple[float, float], behaviors: Sequence[Behavior], loop: WorldLoop, episodes: int) -> float:
    return score_of(subsumption(thresholds, TUNING_SEED, episodes), behaviors, loop).cost


def subsumption(thresholds: tuple[float, float], seed: int, episodes: int) -> FusionParameters:
    """Subsumption with these thresholds (wall [m], psi [rad]) on the first episodes of a run seed."""
    wall_m, approach_rad = thresholds
    return FusionParameters(
        controller="subsumption",
        seed=seed,
        episodes=episodes,
        wall_threshold_m=wall_m,
        approach_threshold_rad=approach_rad,
    )


def grid(n: int) -> list[Weights]:
    """All weights of n behaviors that are multiples of 1 / GRID and sum to 1."""
    return [tuple(part / GRID for part in parts) for parts in product(range(GRID + 1), repeat=n) if sum(parts) == GRID]


def blend_played(weights: Weights, behaviors: Sequence[Behavior], loop: WorldLoop, seed: int, episodes: int) -> Result:
    """Counts of constant weights on the first episodes of a run seed."""
    answers = [behavior.answer for behavior in behaviors]

    def drive(world: World) -> tuple[float, float]:
        left, right = blend(weights, [answer(world) for answer in answers], WHEELS).command
        return left, right

    return driven(drive, loop, seed, episodes)


def best_blend(behaviors: Sequence[Behavior], loop: WorldLoop) -> Weights:
    """The constant weights with the least cost/goal for a tree set, on the episodes that tune Subsumption as well."""

    def cost(weights: Weights, episodes: int) -> float:
        return Score.of(blend_played(weights, behaviors, loop, TUNING_SEED, episodes)).cost

    return cheapest(grid(len(behaviors)), cost, BLEND_ROUNDS)
