"""Two ways to blend that leave the learner as it is: mixtures of two behaviors as further choices, and smoothed commands."""

from __future__ import annotations

from collections.abc import Sequence
from hashlib import sha256
from itertools import combinations

from fbql_behaviors.core.behavior import Behavior
from fbql_common.core.types import BehaviorOutput, World
from fbql_sim.core.parameters import SimulationParameters
from fbql_sim.core.world_loop import WorldLoop


class Mixture(Behavior):
    """Commands the mean of two behaviors' commands. A mixture of a behavior with itself is a copy of it.

    It senses nothing, and has one leaf: which of them drives is learned from what the others report.
    """

    def __init__(self, name: str, first: Behavior, second: Behavior) -> None:
        super().__init__(name, first.tree)
        self.parts = first, second
        self._hash = sha256(f"{first.tree.hash} {second.tree.hash}".encode()).hexdigest()

    def answer(self, world: World) -> BehaviorOutput:
        """The mean of the two references."""
        first, second = (part.answer(world) for part in self.parts)
        return first._replace(
            name=self.name,
            left_rad_s=(first.left_rad_s + second.left_rad_s) / 2.0,
            right_rad_s=(first.right_rad_s + second.right_rad_s) / 2.0,
            leaf_id=0,
            leaf_count=1,
            tree_hash=self._hash,
            clamped=first.clamped or second.clamped,
            observation=(),
        )


def is_mixture(behavior: Behavior) -> bool:
    """Whether it mixes two behaviors that differ."""
    return isinstance(behavior, Mixture) and behavior.parts[0] is not behavior.parts[1]


def with_mixtures(behaviors: Sequence[Behavior]) -> list[Behavior]:
    """The behaviors, then the mixture of each two of them."""
    pairs = combinations(behaviors, 2)
    return [*behaviors, *(Mixture(f"{one.name}_with_{two.name}", one, two) for one, two in pairs)]


def with_copies(behaviors: Sequence[Behavior]) -> list[Behavior]:
    """The behaviors, then a copy of each: as many choices as with mixtures of three, and nothing new to choose."""
    return [*behaviors, *(Mixture(f"{each.name}_copied", each, each) for each in behaviors)]


class SmoothedLoop(WorldLoop):
    """The wheels get a moving average of the commands: of each command its share, of what was sent last the rest.

    Args:
        steps: 1 / share.
    """

    def __init__(self, parameters: SimulationParameters, steps: float) -> None:
        super().__init__(parameters)
        self._share = 1.0 / steps
        self._sent: tuple[float, float] | None = None

    def reset(self, episode: int, seed: int) -> World:
        """Begins an episode, whose first command is sent as it is."""
        self._sent = None
        return super().reset(episode, seed)

    def step(self, left_rad_s: float, right_rad_s: float) -> World:
        """One step; see `WorldLoop`."""
        before = (left_rad_s, right_rad_s) if self._sent is None else self._sent
        left, right = (
            last + self._share * (command - last)
            for last, command in zip(before, (left_rad_s, right_rad_s), strict=True)
        )
        world = super().step(left, right)
        self._sent = left, right
        return world
