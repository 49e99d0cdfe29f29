"""Demonstrations by a scripted instructor: the simulator's world and an instructor's hand, in one process."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import islice

import numpy as np
from fbql_behaviors.core.instructors import Habits, Hand, instructor_of
from fbql_behaviors.core.observation import observation_of
from fbql_behaviors.core.patterns import Demonstration
from fbql_common.core.errors import BadInput
from fbql_common.core.geometry import ball_distance_and_bearing
from fbql_common.core.types import WheelCommand, World
from fbql_sim.core.parameters import SimulationParameters
from fbql_sim.core.world_loop import WorldLoop

ANYWHERE = SimulationParameters(
    start_distance_low_m=0.05,
    start_distance_high_m=2.1,
    start_robot_y_jitter_m=0.82,
    start_yaw_jitter_rad=3.14159,
    start_ball_jitter_m=0.25,
)
"""Starts all over the field and in every direction: a match's own starts show a behavior too little."""
STARTS = {"wall_avoiding": replace(ANYWHERE, start_distance_high_m=0.3)}
"""Starts of the behaviors that need others: walls are avoided near walls, where few starts of `ANYWHERE` lead."""
CLEAR_OF_BALL_M = 0.09
"""Robot and ball start no closer than this: nearer they would overlap."""
HIGHEST_SEED = 2**63 - 1


def simulation_of(behavior: str) -> SimulationParameters:
    """The world that a behavior is demonstrated in."""
    return STARTS.get(behavior, ANYWHERE)


def starts(behavior: str, seed: int) -> Iterator[tuple[int, np.random.Generator]]:
    """The starts of a behavior's demonstrations, without end: the seed of the episode, and a generator for its driver.

    Raises BadInput for a seed out of range.
    """
    _check("seed", seed, 0)
    return _starts(behavior, np.random.SeedSequence([seed, *behavior.encode()]))


def _starts(behavior: str, sequence: np.random.SeedSequence) -> Iterator[tuple[int, np.random.Generator]]:
    loop = WorldLoop(simulation_of(behavior))
    while True:
        rng = np.random.default_rng(sequence.spawn(1)[0])
        episode_seed = int(rng.integers(2**63))
        if ball_distance_and_bearing(loop.reset(0, episode_seed))[0] >= CLEAR_OF_BALL_M:
            yield episode_seed, rng


def instruct(
    behavior: str, seed: int, count: int, steps: int, progress: Callable[[int], None] = lambda _: None
) -> list[Demonstration]:
    """`count` demonstrations of a behavior by its scripted instructor, each of at most `steps` steps.

    The same arguments give the same demonstrations. `progress` is called with the number of those made.
    Raises BadInput for a behavior without an instructor, or a number out of range.
    """
    law, sense = instructor_of(behavior), observation_of(behavior).sense
    _check("demonstrations", count, 1)
    _check("steps", steps, 1)
    loop = WorldLoop(simulation_of(behavior))
    made: list[Demonstration] = []
    for episode_seed, rng in islice(starts(behavior, seed), count):
        world = loop.reset(len(made), episode_seed)
        hand = Hand(law, Habits(), rng)
        worlds: list[World] = []
        commands: list[WheelCommand] = []
        while len(worlds) < steps and not world.terminated:
            left, right = hand.command(sense(world))
            worlds.append(world)
            commands.append(WheelCommand(world.stamp_ns, world.episode, world.step, left, right))
            world = loop.step(left, right)
        made.append(Demonstration(tuple(worlds), tuple(commands)))
        progress(len(made))
    return made


def _check(name: str, value: int, low: int) -> None:
    if not low <= value <= HIGHEST_SEED:
        raise BadInput(f"{name} is {value}; it must be at least {low}")
