"""Imagined soccer: the world model behind a learner's `Imagination`, and which behaviors can be imagined."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from fbql_common.core.command_space import Command
from fbql_common.core.types import World
from numpy.typing import NDArray

from fbql_fusion.core.learners.features import Features
from fbql_fusion.core.tasks.interface import Imagined
from fbql_fusion.core.tasks.soccer.world_model.fitting import can_fit, fit
from fbql_fusion.core.tasks.soccer.world_model.imagination import ImaginedWorld, Rewards
from fbql_fusion.core.tasks.soccer.world_model.parameters import WorldModelParameters
from fbql_fusion.core.tasks.soccer.world_model.real_steps import RealSteps
from fbql_fusion.core.tasks.soccer.world_model.team import SENSES, Team, TreeParts


class PlayingTree(NamedTuple):
    """The tree that a behavior plays with, and what it senses."""

    senses: str
    """The behavior whose observation the tree takes, as the tree file names it."""
    parts: TreeParts


def why_not_imagined(behaviors: Sequence[str], trees: Sequence[PlayingTree]) -> str:
    """Why episodes of these behaviors can't be imagined, in words; "" if they can.

    Args:
        trees: of the behaviors, in order; fewer where they are not known.
    """
    if len(trees) != len(behaviors):
        return "it does not know the trees of the behaviors"
    for name, tree in zip(behaviors, trees, strict=True):
        if tree.senses not in SENSES:
            return f"what behavior '{name}' senses ({tree.senses}) is not one of {', '.join(SENSES)}"
    return ""


class SoccerImagination:
    """See `core.tasks.interface.Imagination`.

    Args:
        trees: of the behaviors, in order; empty if nothing is going to be imagined.

    Raises:
        BadInput: something that is not a tree.
    """

    def __init__(self, parameters: WorldModelParameters, rewards: Rewards, trees: Sequence[PlayingTree]) -> None:
        self._parameters = parameters
        self._rewards = rewards
        self._team = Team([tree.parts for tree in trees], [tree.senses for tree in trees]) if trees else None
        self._steps = RealSteps(parameters.model_capacity)
        self._world: ImaginedWorld | None = None

    @property
    def tree_hashes(self) -> tuple[str, ...]:
        """See `Imagination`."""
        return () if self._team is None else self._team.hashes

    def begin(self, world: World) -> None:
        """See `Imagination`."""
        self._steps.begin(world)

    def add(self, command: Command, world: World) -> None:
        """See `Imagination`."""
        left, right = command
        self._steps.add(left, right, world)

    def forget_episode(self) -> None:
        """See `Imagination`."""
        self._steps.forget_episode()

    def fit(self, features: Features, generator: np.random.Generator) -> bool:
        """See `Imagination`."""
        if self._team is None or not can_fit(self._steps):
            return False
        model = fit(self._steps, self._parameters, generator)
        self._world = ImaginedWorld(model, self._team, features, self._rewards, self._steps, self._parameters)
        return True

    def play(
        self,
        theta: NDArray[np.float64],
        episodes: int,
        hold_steps: int,
        discount: float,
        generator: np.random.Generator,
    ) -> Imagined:
        """See `Imagination`."""
        assert self._world is not None
        found = self._world.play(theta, episodes, hold_steps, discount, generator)
        return Imagined(
            found.lengths,
            found.terminated,
            found.rows,
            found.drivers,
            found.old_probs,
            found.rewards,
            found.discounts,
        )

    def to_arrays(self) -> dict[str, NDArray[Any]]:
        """See `RealSteps.to_arrays`."""
        return self._steps.to_arrays()

    def load_arrays(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """See `RealSteps.from_arrays`."""
        self._steps = RealSteps.from_arrays(arrays, self._parameters.model_capacity)
