"""Demonstrations by a scripted instructor, in the simulator and in one process."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import islice
from math import isfinite

import numpy as np
from fbql_behaviors.core.instructors import Habits, Hand, instructor_of
from fbql_behaviors.core.observation import Law, observation_of
from fbql_behaviors.core.patterns import Demonstration
from fbql_common.core.errors import BadInput
from fbql_common.core.geometry import ball_distance_and_bearing, wrap_angle
from fbql_common.core.types import WheelCommand, World
from fbql_common.core.walls import closest_wall_point
from fbql_sim.core.parameters import SimulationParameters
from fbql_sim.core.physics import Start
from fbql_sim.core.task import NO_EVENTS, Task
from fbql_sim.core.world_loop import WorldLoop

ANYWHERE = SimulationParameters(
    start_distance_low_m=0.05,
    start_distance_high_m=2.1,
    start_robot_y_jitter_m=0.82,
    start_yaw_jitter_rad=3.14159,
    start_ball_jitter_m=0.25,
)
"""Starts all over the field and in every direction: the starts of a match cover too little."""
STARTS = {"wall_avoiding": replace(ANYWHERE, start_distance_high_m=0.3)}
"""Starts of behaviors that need different ones: walls are avoided near walls, which few starts of `ANYWHERE` reach."""
CLEAR_OF_BALL_M = 0.09
"""Robot and ball start no closer than this: nearer they would overlap."""
MOST_TRIES = 20_000
"""How many starts are tried until one lies inside the behavior's root region."""
HIGHEST_SEED = 2**63 - 1


def simulation_of(behavior: str) -> SimulationParameters:
    """The world that a behavior is demonstrated in."""
    return STARTS.get(behavior, ANYWHERE)


def starts(behavior: str, seed: int) -> Iterator[tuple[int, np.random.Generator]]:
    """The starts of a behavior's demonstrations, without end: the seed of each episode, and a generator for its driver.

    They lie inside its root region. Raises BadInput for a seed out of range, and where no such start is found.
    """
    _check("seed", seed, 0)
    return _starts(behavior, np.random.SeedSequence([seed, *behavior.encode()]))


def _starts(behavior: str, sequence: np.random.SeedSequence) -> Iterator[tuple[int, np.random.Generator]]:
    task = Task(simulation_of(behavior))
    observation = observation_of(behavior)
    while True:
        for _ in range(MOST_TRIES):
            rng = np.random.default_rng(sequence.spawn(1)[0])
            episode_seed = int(rng.integers(2**63))
            world = at_rest(task.begin(episode_seed))
            is_clear = ball_distance_and_bearing(world)[0] >= CLEAR_OF_BALL_M
            if is_clear and observation.contains(observation.sense(world)):
                yield episode_seed, rng
                break
        else:
            raise BadInput(
                f"behavior '{behavior}': none of {MOST_TRIES} starts lies inside its root region; widen its features' "
                "ranges, or let a person demonstrate (--keyboard)"
            )


def at_rest(start: Start) -> World:
    """The world of step 0 of an episode with this start, without the physics, which takes ten times as long."""
    x, y = start.robot_x_m, start.robot_y_m
    robot = (x, y, wrap_angle(start.robot_yaw_rad), 0.0, 0.0)
    ball = (start.ball_x_m, start.ball_y_m, 0.0, 0.0)
    return World(0, 0, 0, *robot, *ball, *closest_wall_point(x, y), *NO_EVENTS)


def instruct(
    behavior: str,
    seed: int,
    count: int,
    steps: int,
    progress: Callable[[int], None] = lambda _: None,
    law: Law | None = None,
) -> list[Demonstration]:
    """`count` demonstrations of a behavior by its scripted instructor, each of at most `steps` steps.

    The same arguments give the same demonstrations. `progress` is called with the number made so far. `law` drives in
    the instructor's place.
    Raises BadInput for a behavior without an instructor or with one that fails, or a number out of range.
    """
    law, sense = law or instructor_of(behavior), observation_of(behavior).sense
    if law is observation_of(behavior).instructor:
        law = _guard(law, behavior)
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


def _guard(law: Law, behavior: str) -> Law:
    """A user-supplied law, with its errors reported in one line."""

    def answer(observed: Sequence[float]) -> tuple[float, float]:
        call = f"the instructor of behavior '{behavior}', called with ({', '.join(f'{x:g}' for x in observed)}),"
        try:
            left, right = law(observed)
            if isfinite(left + right):
                return left, right
        except Exception as error:  # whatever a foreign function raises
            reason = " ".join(str(error).split())
            raise BadInput(
                f"{call} fails ({type(error).__name__}: {reason}); it must return left, right [rad/s]"
            ) from None
        raise BadInput(f"{call} returns {left}, {right}; wheel velocities must be finite [rad/s]")

    return answer


def _check(name: str, value: int, low: int) -> None:
    if not low <= value <= HIGHEST_SEED:
        raise BadInput(f"{name} is {value}; it must be at least {low}")
