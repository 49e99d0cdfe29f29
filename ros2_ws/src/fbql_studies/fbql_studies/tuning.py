"""What is tuned for each tree set, on episodes that judge nothing: Subsumption's thresholds."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from fbql.match.in_process import play
from fbql_behaviors.core.behavior import Behavior
from fbql_fusion.core.parameters import FusionParameters
from fbql_fusion.core.session import Session
from fbql_sim.core.world_loop import WorldLoop

TUNING_SEED = 11
Rounds = Sequence[tuple[int, int]]
"""Training episodes that each candidate plays, and how many of them are left after it."""
TUNING_ROUNDS: Rounds = ((30, 12), (150, 4), (500, 1))
WALL_M = (0.0, 0.06, 0.07, 0.08, 0.10, 0.12)
APPROACH_RAD = (0.0, 0.05, 0.1, 0.15, 0.3, 1.0)


def cheapest[Candidate](
    candidates: Sequence[Candidate], cost: Callable[[Candidate, int], float], rounds: Rounds
) -> Candidate:
    """The candidate with the least cost(candidate, episodes); the first of equal ones.

    All play a few episodes, the best of them many: a deadlock that comes once in fifty episodes decides what a candidate
    is worth, and few episodes don't show it: chosen on 30 alone, a pair of thresholds had 6 timeouts in 100 fresh episodes.
    """
    left = list(candidates)
    for episodes, kept in rounds:
        if len(left) > kept:
            costs = {candidate: cost(candidate, episodes) for candidate in left}
            left = sorted(left, key=lambda candidate: costs[candidate])[:kept]
    return left[0]


def retuned(behaviors: Sequence[Behavior], loop: WorldLoop) -> tuple[float, float]:
    """Subsumption's thresholds (wall [m], psi [rad]) with the least cost/goal for a tree set, on training episodes."""
    pairs = [(wall_m, approach_rad) for wall_m in WALL_M for approach_rad in APPROACH_RAD]
    return cheapest(pairs, lambda pair, episodes: _cost_with(pair, behaviors, loop, episodes), TUNING_ROUNDS)


def _cost_with(thresholds: tuple[float, float], behaviors: Sequence[Behavior], loop: WorldLoop, episodes: int) -> float:
    """cost/goal on so many training episodes; infinite without a goal."""
    wall_m, approach_rad = thresholds
    fusion = FusionParameters(
        controller="subsumption",
        seed=TUNING_SEED,
        episodes=episodes,
        wall_threshold_m=wall_m,
        approach_threshold_rad=approach_rad,
    )
    session = Session(fusion)
    play(session, loop, behaviors, lambda: True)
    cost = session.summary().cost_per_goal
    return float("inf") if cost is None else cost
