"""Controls that learn nothing or only a few numbers: Subsumption, equal and constant weights, single behaviors, the law."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from fbql_behaviors.core.behavior import Behavior
from fbql_fusion.core.controllers.interface import one_hot_weights
from fbql_fusion.core.parameters import FusionParameters
from fbql_sim.core.world_loop import WorldLoop

from fbql_studies.common import methods
from fbql_studies.common.methods import BEHAVIORS, CONSTANT, PAPER, RETUNED, TUNED, UNIFORM
from fbql_studies.common.play import LAWS, Score, score_of
from fbql_studies.common.tuning import TUNING_SEED, Weights, blend_played, grid, retuned
from fbql_studies.peers.play import score_of_law

ALONE = tuple(f"{name} alone" for name in BEHAVIORS)
METHODS = (*methods.CONTROLS, *ALONE)


class Controls:
    """The controls of one tree set, tuned for it on training episodes alone.

    Args:
        behaviors: the behaviors of the tree set, in the order of BEHAVIORS.
        budget: simulated steps that the search for constant weights may use.
    """

    def __init__(self, behaviors: Sequence[Behavior], budget: int) -> None:
        self._behaviors = list(behaviors)
        self._loop = WorldLoop()
        self.thresholds = retuned(self._behaviors, self._loop)
        self.weights, self.weights_steps = self._best_weights(budget)

    def _best_weights(self, budget: int) -> tuple[Weights, int]:
        """The constant weights with the least cost/goal: as many training episodes for each as the budget allows."""
        scores = {weights: [0, 0] for weights in grid(len(self._behaviors))}
        used = episode = 0
        while used < budget:
            for weights, found in scores.items():
                score = self._score(weights, TUNING_SEED + episode, 1)
                found[0] += score.steps
                found[1] += score.goals
                used += score.steps
            episode += 1
        best = min(scores, key=lambda each: scores[each][0] / scores[each][1] if scores[each][1] else float("inf"))
        return best, used

    def play(self, run_seed: int, episodes: int) -> dict[str, Score]:
        """Every control on the first episodes of a run seed."""
        fusion = FusionParameters(controller="subsumption", seed=run_seed, episodes=episodes)
        wall_m, approach_rad = self.thresholds
        sessions = {
            PAPER: replace(fusion, preset="paper"),
            TUNED: replace(fusion, preset="tuned"),
            RETUNED: replace(fusion, wall_threshold_m=wall_m, approach_threshold_rad=approach_rad),
            UNIFORM: replace(fusion, controller="uniform"),
        }
        found = {method: score_of_law(run_seed, episodes, constants) for method, constants in LAWS.items()}
        for method, each in sessions.items():
            found[method] = score_of(each, self._behaviors, self._loop)
        single = one_hot_weights(len(self._behaviors))
        for method, weights in {CONSTANT: self.weights, **dict(zip(ALONE, single, strict=True))}.items():
            found[method] = self._score(weights, run_seed, episodes)
        return found

    def _score(self, weights: Weights, run_seed: int, episodes: int) -> Score:
        """The score of constant weights on the first episodes of a run seed."""
        return Score.of(blend_played(weights, self._behaviors, self._loop, run_seed, episodes))
