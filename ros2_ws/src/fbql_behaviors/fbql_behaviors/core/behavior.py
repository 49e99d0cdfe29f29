"""A behavior: an observation and a tree that answer every world state with a reference."""

from __future__ import annotations

from math import isfinite

from fbql_common.core.errors import BadInput
from fbql_common.core.types import BehaviorOutput, World, made_of

from fbql_behaviors.core.observation import Observation, observation_of
from fbql_behaviors.core.tree import Tree


class Behavior:
    """B_i: answers a world state with the reference of the leaf that its observation falls into.

    An observation outside the tree's root region is answered by the leaf at its edge, with `clamped` set;
    `clamped_count` counts such answers.
    """

    def __init__(self, name: str, tree: Tree, observation: Observation | None = None) -> None:
        """`observation` defaults to the registered one of the tree's behavior.

        Raises BadInput when tree and observation have different features, or the tree commands no wheels.
        """
        _ = tree.wheel_leaves
        self.name = name
        self.tree = tree
        self.clamped_count = 0
        observation = observation or observation_of(tree.behavior)
        check_features(tree, observation)
        self._sense = observation.sense
        self._answer = tree.answer
        self._contains = tree.contains
        self._leaf_count = tree.leaf_count
        self._hash = tree.hash

    def __getstate__(self) -> dict[str, object]:
        """Everything but the compiled tree, which can't be copied."""
        return {name: value for name, value in self.__dict__.items() if name != "_contains"}

    def __setstate__(self, state: dict[str, object]) -> None:
        self.__dict__.update(state)
        self._contains = self.tree.contains

    def answer(self, world: World) -> BehaviorOutput:
        """The reference for a world state. Raises BadInput when the observation is not finite."""
        observation = self._sense(world)
        clamped = not self._contains(observation)
        if clamped:
            self._count_clamped(observation)
        leaf_id, left, right = self._answer(observation)
        values = (
            world.stamp_ns,
            world.episode,
            world.step,
            self.name,
            left,
            right,
            leaf_id,
            self._leaf_count,
            self._hash,
            clamped,
            observation,
        )
        return made_of(BehaviorOutput, values)

    def _count_clamped(self, observation: tuple[float, ...]) -> None:
        for feature, value in zip(self.tree.features, observation, strict=True):
            if not isfinite(value):
                raise BadInput(
                    f"behavior '{self.name}': feature '{feature.name}' is {value}; the world state is not usable"
                )
        self.clamped_count += 1


def check_features(tree: Tree, observation: Observation) -> None:
    """Raises BadInput unless a tree has the features of an observation, in order, with the same units."""
    expected = [(feature.name, feature.unit) for feature in observation.features]
    actual = [(feature.name, feature.unit) for feature in tree.features]
    if actual != expected:
        raise BadInput(f"features are {_list(actual)}; behavior '{tree.behavior}' senses {_list(expected)}")


def _list(features: list[tuple[str, str]]) -> str:
    return ", ".join(f"{name} [{unit}]" for name, unit in features)
