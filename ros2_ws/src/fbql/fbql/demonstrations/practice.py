"""The simulator as an environment in which the leaves of a tree are tuned, and trees are measured."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from fbql_behaviors.core.exercises import Attempt, Exercise, drive
from fbql_behaviors.core.tree import Tree
from fbql_common.core.geometry import ball_distance_and_bearing
from fbql_common.core.types import World
from fbql_sim.core.world_loop import WorldLoop

from fbql.demonstrations.instruct import ANYWHERE, CLEAR_OF_BALL_M

STARTS = {"approaching": replace(ANYWHERE, start_ball_jitter_m=0.05)}
"""Starts of behaviors that need other ones than `ANYWHERE`: there is no room behind a ball at a wall."""
MEASURING = 1
"""Keeps the seeds of measuring apart from those of tuning."""


class PracticeGround:
    """The simulator as an `Environment`: episodes begin all over the field, with the robot clear of the ball."""

    def __init__(self, behavior: str) -> None:
        self._loop = WorldLoop(STARTS.get(behavior, ANYWHERE))
        self.dt_s = self._loop.dt_s
        self.step: Callable[[float, float], World] = self._loop.step

    def reset(self, seed: int) -> World:
        """The first world of a seed's episode: the first start of its sequence that is clear of the ball."""
        rng = np.random.default_rng(seed)
        while True:
            world = self._loop.reset(0, int(rng.integers(2**63)))
            if ball_distance_and_bearing(world)[0] >= CLEAR_OF_BALL_M:
                return world


def measuring_seeds(seed: int, episodes: int) -> list[int]:
    """Seeds of the episodes that trees are measured on. `tune` always draws different ones."""
    words = np.random.SeedSequence([seed, MEASURING]).generate_state(episodes, np.uint64)
    return [int(word >> np.uint64(1)) for word in words]


def measure(tree: Tree, exercise: Exercise, ground: PracticeGround, seeds: Sequence[int]) -> list[Attempt]:
    """Drives the episodes of these seeds; a seed gives the same start for every tree."""
    return [drive(tree, exercise, ground, seed) for seed in seeds]
