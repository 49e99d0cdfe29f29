"""Exercises for leaf tuning: rewards, ends and costs of an attempt, as pure functions of world states.

Rewards are in steps. They pay for progress, not only for arriving, so that every leaf on the way learns whether it helps:
their sum over an attempt is minus the steps lost compared with driving at full speed. An `Environment` is anything that
can be reset and stepped; the caller provides it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import acos, cos, hypot, sqrt
from typing import NamedTuple, Protocol

from fbql_common.core.errors import BadInput
from fbql_common.core.field import BALL_RADIUS_M, MAX_WHEEL_RAD_S, ROBOT_SIDE_M, WHEEL_RADIUS_M
from fbql_common.core.geometry import (
    DETOUR_RADIUS_M,
    approach_angle,
    ball_distance_and_bearing,
    wall_distance_and_bearing,
)
from fbql_common.core.types import World

from fbql_behaviors.core.observation import observation_of
from fbql_behaviors.core.tree import Tree

FULL_SPEED_M_S = MAX_WHEEL_RAD_S * WHEEL_RADIUS_M
TOUCH_M = hypot(ROBOT_SIDE_M / 2, ROBOT_SIDE_M / 2) + BALL_RADIUS_M
"""Distance of the ball from the robot's center at which the robot may touch it, whatever its heading [m]."""
FACING_STEPS = 12.0
"""Reward of facing the ball better by a radian [steps]: turning by a radian takes about as long."""
NEAR_WALL_M = 0.2
"""Distance below which moving away from a wall is progress [m]."""
CONTACT_STEPS = 10.0
"""Cost of a step in contact with a wall [steps]."""
TAKE_OVER_M = 0.1
"""Distance to a wall below which wall avoiding drives in its exercise [m]."""
WANDER_RAD_S = 60.0
"""Wheel velocity of the blind driver [rad/s]: as fast as the behaviors drive."""
BEHIND_M = 0.15
"""Distance of the ball below which the robot may stand behind it [m]: just off the detour."""
BEHIND_RAD = 0.3
"""|psi| below which it stands in line with the goal [rad]."""
AHEAD_RAD = 0.3
"""|bearing| below which the robot has the ball ahead [rad]."""
OWN_GOAL_STEPS = 300.0
"""Cost of an own goal [steps]: it must not pay to end an episode that way."""

Command = tuple[float, float]
"""Wheel velocities, left and right [rad/s]."""


class Environment(Protocol):
    """A world to practice in, such as the simulator."""

    def reset(self, seed: int) -> World:
        """Begins an episode; the seed decides the start and every disturbance."""
        ...

    def step(self, left_rad_s: float, right_rad_s: float, /) -> World:
        """Drives the wheels for one step [rad/s] and returns the next world."""
        ...


class Attempt(NamedTuple):
    """One episode of an exercise, driven to its end."""

    steps: int
    arrived: bool
    collisions_begun: int
    collision_steps: int
    travelled_m: float


@dataclass(frozen=True)
class Exercise:
    """What a behavior practices, and how its trees are compared."""

    reward: Callable[[World, World, float], float]
    """The reward of going from a world to the next one [steps], given the duration of a step [s]."""
    arrived: Callable[[World], bool]
    """Whether the attempt has reached its end: its value is then 0."""
    max_steps: int
    """Steps after which an attempt is truncated."""
    cost: Callable[[Attempt], float]
    """Cost of an attempt, lower is better. A tree's measure is the mean over attempts."""
    measure: str
    """Name of that mean, with its unit."""
    other_driver: Callable[[World], Command | None]
    """The command where the behavior does not drive; None where it does."""


def ball_seeking_reward(world: World, next_world: World, dt_s: float) -> float:
    """Progress in distance to the ball, in steps at full speed, and in bearing, less the step itself."""
    distance_m, bearing_rad = ball_distance_and_bearing(world)
    next_distance_m, next_bearing_rad = ball_distance_and_bearing(next_world)
    return (
        (distance_m - next_distance_m) / (FULL_SPEED_M_S * dt_s)
        + FACING_STEPS * (abs(bearing_rad) - abs(next_bearing_rad))
        - 1.0
    )


def reaches_ball(world: World) -> bool:
    """Whether the ball is near enough for the robot to touch it."""
    return ball_distance_and_bearing(world)[0] <= TOUCH_M


def wall_avoiding_reward(world: World, next_world: World, dt_s: float) -> float:
    """Distance driven and, near a wall, distance gained from it, in steps at full speed, less the cost of contact."""
    way_m = hypot(next_world.robot_x_m - world.robot_x_m, next_world.robot_y_m - world.robot_y_m)
    distance_m = min(wall_distance_and_bearing(world)[0], NEAR_WALL_M)
    next_distance_m = min(wall_distance_and_bearing(next_world)[0], NEAR_WALL_M)
    return (way_m + next_distance_m - distance_m) / (FULL_SPEED_M_S * dt_s) - CONTACT_STEPS * next_world.collision


def blind_driver(world: World) -> Command | None:
    """Drives straight on until a wall is near, where wall avoiding has to take over, as in a match."""
    if wall_distance_and_bearing(world)[0] < TAKE_OVER_M:
        return None
    return WANDER_RAD_S, WANDER_RAD_S


def way_behind_ball(distance_m: float, psi_rad: float) -> float:
    """The shortest path [m] to the place behind the ball, `DETOUR_RADIUS_M` from it, round a circle of that radius.

    Where the circle hides the place, the path is the tangent to the circle, on which psi turns by acos(radius / distance),
    and an arc for the rest of psi. From inside the circle it leads straight out, then along the arc.
    """
    radius_m, psi_rad = DETOUR_RADIUS_M, abs(psi_rad)
    if distance_m <= radius_m:
        return radius_m - distance_m + radius_m * psi_rad
    hidden_rad = acos(radius_m / distance_m)
    if psi_rad <= hidden_rad:
        return sqrt(max(distance_m**2 + radius_m**2 - 2.0 * distance_m * radius_m * cos(psi_rad), 0.0))
    return sqrt(distance_m**2 - radius_m**2) + radius_m * (psi_rad - hidden_rad)


def approaching_reward(world: World, next_world: World, dt_s: float) -> float:
    """Progress on the way behind the ball, in steps at full speed, less the step itself and the cost of an own goal."""
    gained_m = _way_behind_ball(world) - _way_behind_ball(next_world)
    return gained_m / (FULL_SPEED_M_S * dt_s) - 1.0 - OWN_GOAL_STEPS * next_world.own_goal


def _way_behind_ball(world: World) -> float:
    return way_behind_ball(ball_distance_and_bearing(world)[0], approach_angle(world))


def stands_behind_ball(world: World) -> bool:
    """Whether the robot stands behind the ball, in line with the goal and facing it; or has scored already."""
    distance_m, bearing_rad = ball_distance_and_bearing(world)
    is_there = distance_m < BEHIND_M and abs(approach_angle(world)) < BEHIND_RAD and abs(bearing_rad) < AHEAD_RAD
    return is_there or world.goal


def steps_to_arrive(max_steps: int) -> Callable[[Attempt], float]:
    """The cost of an attempt that should arrive: its steps, or `max_steps` when it did not."""
    return lambda attempt: float(attempt.steps if attempt.arrived else max_steps)


def contact_per_1000_steps(attempt: Attempt) -> float:
    """The cost of an attempt that should not touch a wall."""
    return 1000.0 * attempt.collision_steps / attempt.steps


EXERCISES: dict[str, Exercise] = {
    "ball_seeking": Exercise(
        ball_seeking_reward, reaches_ball, 600, steps_to_arrive(600), "steps to the ball", lambda _: None
    ),
    "wall_avoiding": Exercise(
        wall_avoiding_reward,
        lambda _: False,
        1000,
        contact_per_1000_steps,
        "contact steps per 1000 steps",
        blind_driver,
    ),
    "approaching": Exercise(
        approaching_reward, stands_behind_ball, 600, steps_to_arrive(600), "steps until behind the ball", lambda _: None
    ),
}
"""Behavior name -> its exercise."""


def exercise_of(behavior: str) -> Exercise:
    """The exercise of a behavior. Raises BadInput, listing the behaviors that have one, when there is none."""
    try:
        return EXERCISES[behavior]
    except KeyError:
        raise BadInput(
            f"behavior '{behavior}' has no exercise to be tuned with; there is one for: {', '.join(sorted(EXERCISES))}"
        ) from None


def drive(tree: Tree, exercise: Exercise, environment: Environment, seed: int) -> Attempt:
    """Drives one episode with a tree, without learning."""
    sense = observation_of(tree.behavior).sense
    return drive_by(lambda world: tree.answer(sense(world))[1:], exercise, environment, seed)


def drive_by(
    command_of: Callable[[World], Sequence[float]], exercise: Exercise, environment: Environment, seed: int
) -> Attempt:
    """Drives one episode.

    Args:
        command_of: the wheel velocities in a world, where the behavior drives, left and right [rad/s].
    """
    world = environment.reset(seed)
    steps = collisions_begun = collision_steps = 0
    travelled_m = 0.0
    arrived = exercise.arrived(world)
    while not (arrived or world.ended or steps == exercise.max_steps):
        left, right = exercise.other_driver(world) or command_of(world)
        next_world = environment.step(left, right)
        steps += 1
        collisions_begun += next_world.collision_begun
        collision_steps += next_world.collision
        travelled_m += hypot(next_world.robot_x_m - world.robot_x_m, next_world.robot_y_m - world.robot_y_m)
        world = next_world
        arrived = exercise.arrived(world)
    return Attempt(steps, arrived, collisions_begun, collision_steps, travelled_m)


def mean_cost(attempts: Sequence[Attempt], exercise: Exercise) -> float:
    """The measure of a tree: the mean cost of its attempts."""
    return sum(map(exercise.cost, attempts)) / len(attempts)
