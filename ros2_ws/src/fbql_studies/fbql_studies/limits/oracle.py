"""Selection by rollouts (Tesauro and Galperin 1996) in the simulator itself; the base policy is the tuned law.

What it costs is an upper bound on what the best selection costs, since it tries only a few plans.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

from fbql_behaviors.core.behavior import Behavior
from fbql_common.core.types import World
from fbql_sim.core.parameters import SimulationParameters
from fbql_sim.core.scripted_law import TUNED, law
from fbql_sim.core.world_loop import WorldLoop

EVERY = 4
"""Steps from one selection to the next."""
ALONE = (4, 12, 32, 80)
"""Steps that one choice is tried for."""
IN_TURN = (8, 32)
"""Steps of each of two choices that are tried one after the other."""
MOST_STEPS = 1000
"""What a plan costs that does not end in a goal."""

Drive = Callable[[World], tuple[float, float]]


class Tried(NamedTuple):
    """The beginning of a plan."""

    driver: int
    """The choice that it begins with."""
    steps: int
    world: World
    """Where it leads."""


class SelectingOracle:
    """Drives as the behavior does with which the quickest plan begins.

    A plan is one choice for a while, or two in turn, and then the tuned law to the end of the episode. Plans are rolled
    forward from the world as it is, without the gains and the noise of the wheels, which the oracle does not know.

    Args:
        behaviors: the choices.
        parameters: the world that is played in.
    """

    def __init__(self, behaviors: Sequence[Behavior], parameters: SimulationParameters) -> None:
        exact = {"wheel_gain_deviation": 0.0, "wheel_noise_deviation": 0.0, "max_steps": MOST_STEPS}
        self._loop = WorldLoop(replace(parameters, **exact))
        self._choices = [partial(_driven_by, behavior) for behavior in behaviors]
        self._driver = 0

    def drive(self, world: World) -> tuple[float, float]:
        """Wheel velocities [rad/s]; selects anew at every EVERY-th step. Takes every world of an episode in order."""
        if world.step % EVERY == 0:
            self._driver = self._select(world)
        return self._choices[self._driver](world)

    def _select(self, world: World) -> int:
        """The choice that the quickest plan begins with; of equal ones the present driver."""
        least, driver = MOST_STEPS, self._driver
        # The present driver's plans first: the sooner a good one is known, the sooner others are given up.
        for tried in sorted(self._plans(world), key=lambda tried: tried.driver != self._driver):
            steps = self._steps_to_goal(tried, least)
            if steps < least:
                least, driver = steps, tried.driver
        return driver

    def _plans(self, world: World) -> Iterator[Tried]:
        for i, choice in enumerate(self._choices):
            start = Tried(i, 0, world)
            yield from self._while_driven(start, choice, ALONE)
            for first in self._while_driven(start, choice, IN_TURN):
                if not first.world.ended:
                    for j, other in enumerate(self._choices):
                        if j != i:
                            yield from self._while_driven(first, other, IN_TURN)

    def _while_driven(self, start: Tried, choice: Drive, marks: Sequence[int]) -> list[Tried]:
        """What a choice leads to after each of these steps; the last one may have ended sooner."""
        world = self._loop.resume(start.world)
        found: list[Tried] = []
        for steps in range(1, marks[-1] + 1):
            world = self._loop.step(*choice(world))
            if steps in marks or world.ended:
                found.append(Tried(start.driver, start.steps + steps, world))
            if world.ended:
                break
        return found

    def _steps_to_goal(self, tried: Tried, most: int) -> int:
        """Steps to the goal when the law goes on; `most` if they are not fewer."""
        steps, world = tried.steps, tried.world
        if not world.ended:
            world = self._loop.resume(world)
        while not world.ended and steps < most:
            world = self._loop.step(*law(world, TUNED))
            steps += 1
        return min(steps, most) if world.goal else most


def _driven_by(behavior: Behavior, world: World) -> tuple[float, float]:
    return behavior.answer(world).command
