"""The score of a set of trees in play: the team under Subsumption, in-process, on episodes that no tuning saw."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import product
from typing import Any

from fbql.statistics.inference import mean_interval, paired_p_value
from fbql.statistics.tables import Row, finite
from fbql_behaviors.core.behavior import Behavior
from fbql_behaviors.core.tree import Tree
from fbql_fusion.core.parameters import FusionParameters
from fbql_fusion.core.tasks.soccer.subsumption import Thresholds
from fbql_sim.core.world_loop import WorldLoop

from fbql_studies.common.play import Score, score_of
from fbql_studies.common.tuning import TUNING_SEED, subsumption

PRESETS = {"fixed": Thresholds(0.07, 0.15), "paper": Thresholds(0.07, 2.2)}
"""Thresholds that are the same for every set of trees; `fixed` plays well with most."""
RETUNED = "re-tuned"
"""Thresholds chosen for each set of trees: the best that Subsumption can make of it."""
SETTINGS = (*PRESETS, RETUNED)
FIXED_ONLY = SETTINGS[:1]
PRESETS_ONLY = SETTINGS[:2]
WALL_M = (0.06, 0.07, 0.08, 0.10, 0.12)
APPROACH_RAD = (0.0, 0.15, 0.3, 0.6)
TUNING_EPISODES = 20

TEAM_MEASURES: dict[str, Callable[[Mapping[str, Any]], float]] = {
    "success rate": lambda team: team["goals"] / team["episodes"],
    "cost per goal": lambda team: team["steps"] / max(team["goals"], 1),
    "own goals per 100 episodes": lambda team: 100 * team["own_goals"] / team["episodes"],
    "timeouts per 100 episodes": lambda team: 100 * team["timeouts"] / team["episodes"],
    "collisions begun per episode": lambda team: team["collisions_begun"] / team["episodes"],
    "contact steps per episode": lambda team: team["collision_steps"] / team["episodes"],
}
"""Name of a measure -> its value from a team's counts."""


PAIRED_COLUMNS = {
    "low": "the lower end of its 95 % interval, a bootstrap over the seeds; null with one",
    "high": "the upper end; null with one",
    "p": "p of the sign-flip test, paired by seed, that there is no difference; null with one",
}
"""The columns of a paired difference."""


def score(trees: Mapping[str, Tree], thresholds: Thresholds, seed: int, episodes: int) -> Score:
    """The score of a set of trees on the first episodes of a run seed."""
    behaviors = [Behavior(name, trees[name]) for name in FusionParameters().behaviors]
    return score_of(subsumption(thresholds, seed, episodes), behaviors, WorldLoop())


def retuned(trees: Mapping[str, Tree]) -> Thresholds:
    """The thresholds of the grid with the least cost/goal on the tuning episodes; the first of equal ones."""
    pairs = [Thresholds(*pair) for pair in product(WALL_M, APPROACH_RAD)]
    return min(pairs, key=lambda pair: score(trees, pair, TUNING_SEED, TUNING_EPISODES).cost)


def paired_difference(ours: Sequence[float], theirs: Sequence[float]) -> Row:
    """Mean of ours - theirs over the seeds, with its 95 % interval and p."""
    found = mean_interval([one - other for one, other in zip(ours, theirs, strict=True)])
    p = paired_p_value(ours, theirs)
    return finite({"difference": found.estimate, "low": found.low, "high": found.high, "p": p})


def spoken(behavior: str) -> str:
    """The name of a behavior in a text."""
    return behavior.replace("_", " ")
