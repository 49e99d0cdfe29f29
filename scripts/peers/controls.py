"""What learns nothing, or only a few numbers: Subsumption, equal and constant weights, each behavior alone, the scripted law."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import product

from fbql_behaviors.core.behavior import Behavior
from fbql_fusion.core.parameters import FusionParameters
from fbql_sim.core.world_loop import WorldLoop
from studies.paper import BEHAVIORS, TUNING_SEED, retuned
from studies.tree_play import Score

from peers.play import score_in, score_of_law, score_of_session
from peers.team_env import BlendEnv

LAW, UNIFORM, CONSTANT = "scripted law, sees all", "uniform weights", "constant blend"
PAPER, TUNED, RETUNED = "subsumption, paper", "subsumption, tuned", "subsumption, re-tuned"
ALONE = tuple(f"{name} alone" for name in BEHAVIORS)
METHODS = (LAW, PAPER, TUNED, RETUNED, UNIFORM, CONSTANT, *ALONE)
GRID = 5
"""Constant weights are multiples of 1 / GRID."""
WHOLE_EPISODE = 100_000


class Controls:
    """The controls of one tree set, tuned for it on training episodes alone.

    Args:
        behaviors: the behaviors of the tree set, in the order of BEHAVIORS.
        budget: simulated steps that the search for constant weights may use.
    """

    def __init__(self, behaviors: Sequence[Behavior], budget: int) -> None:
        self._behaviors = list(behaviors)
        self._loop = WorldLoop()
        self._env = BlendEnv(self._behaviors, action="weights", hold_steps=WHOLE_EPISODE)
        self.thresholds = retuned(self._behaviors, self._loop)
        self.weights, self.weights_steps = self._best_weights(budget)

    def _best_weights(self, budget: int) -> tuple[tuple[float, ...], int]:
        """The constant weights with the least cost/goal: as many training episodes for each as the budget allows."""
        scores = {weights: [0, 0] for weights in grid(len(self._behaviors))}
        used = episode = 0
        while used < budget:
            for weights, found in scores.items():
                score = score_in(self._env, lambda _, weights=weights: weights, TUNING_SEED + episode, 1)
                found[0] += score.steps
                found[1] += score.goals
                used += score.steps
            episode += 1
        best = min(scores, key=lambda each: scores[each][0] / scores[each][1] if scores[each][1] else float("inf"))
        return best, used

    def play(self, run_seed: int, episodes: int) -> dict[str, Score]:
        """Every control on so many episodes of a run seed."""
        fusion = FusionParameters(controller="subsumption", seed=run_seed, episodes=episodes)
        wall_m, approach_rad = self.thresholds
        sessions = {
            PAPER: replace(fusion, preset="paper"),
            TUNED: replace(fusion, preset="tuned"),
            RETUNED: replace(fusion, wall_threshold_m=wall_m, approach_threshold_rad=approach_rad),
            UNIFORM: replace(fusion, controller="uniform"),
        }
        found = {LAW: score_of_law(run_seed, episodes)}
        for method, each in sessions.items():
            found[method] = score_of_session(each, self._behaviors, self._loop)
        places = range(len(self._behaviors))
        single = [tuple(1.0 if i == driver else 0.0 for i in places) for driver in places]
        for method, weights in {CONSTANT: self.weights, **dict(zip(ALONE, single, strict=True))}.items():
            found[method] = score_in(self._env, lambda _, weights=weights: weights, run_seed, episodes)
        return found


def grid(n: int) -> list[tuple[float, ...]]:
    """All weights of n behaviors that are multiples of 1 / GRID and sum to 1."""
    return [tuple(part / GRID for part in parts) for parts in product(range(GRID + 1), repeat=n) if sum(parts) == GRID]
