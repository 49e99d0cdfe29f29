"""What a set of trees is worth in play: the whole team under Subsumption, in-process, on episodes that no tuning saw."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import product
from typing import NamedTuple

from fbql.match.in_process import play
from fbql_behaviors.core.behavior import Behavior
from fbql_behaviors.core.tree import Tree
from fbql_fusion.core.parameters import FusionParameters, Thresholds
from fbql_fusion.core.session import Session
from fbql_sim.core.world_loop import WorldLoop

PRESETS = {"fixed": Thresholds(0.07, 0.15), "paper": Thresholds(0.07, 2.2)}
"""Thresholds that are the same for every set of trees; `fixed` plays well with most."""
RETUNED = "re-tuned"
"""Thresholds chosen for each set of trees: what Subsumption can make of it."""
SETTINGS = (*PRESETS, RETUNED)
FIXED_ONLY = SETTINGS[:1]
PRESETS_ONLY = SETTINGS[:2]
WALL_M = (0.06, 0.07, 0.08, 0.10, 0.12)
APPROACH_RAD = (0.0, 0.15, 0.3, 0.6)
TUNING_SEED = 11
"""Run seed of the episodes that thresholds are chosen on; those below 1000 are for tuning."""
TUNING_EPISODES = 20


class Score(NamedTuple):
    """What was counted over the episodes of a run."""

    episodes: int
    goals: int
    own_goals: int
    timeouts: int
    steps: int
    collisions_begun: int
    collision_steps: int


def score(trees: Mapping[str, Tree], thresholds: Thresholds, seed: int, episodes: int) -> Score:
    """Plays so many episodes of a run seed."""
    fusion = FusionParameters(
        controller="subsumption",
        seed=seed,
        episodes=episodes,
        wall_threshold_m=thresholds.wall_m,
        approach_threshold_rad=thresholds.approach_rad,
    )
    session = Session(fusion)
    play(session, WorldLoop(), [Behavior(name, trees[name]) for name in fusion.behaviors], lambda: True)
    summary = session.summary()
    return Score(*(getattr(summary, name) for name in Score._fields))


def retuned(trees: Mapping[str, Tree]) -> Thresholds:
    """The thresholds of the grid with the least cost/goal on the tuning episodes; the first of equal ones."""

    def cost(thresholds: Thresholds) -> float:
        found = score(trees, thresholds, TUNING_SEED, TUNING_EPISODES)
        return found.steps / found.goals if found.goals else float("inf")

    return min((Thresholds(*pair) for pair in product(WALL_M, APPROACH_RAD)), key=cost)
