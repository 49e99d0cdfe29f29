"""What each behavior senses: pure functions from a world state to a few numbers.

An `Observation` declares its features (name, unit, root region) beside the function, because the patterns, the tree and
the tree file all depend on them. A new behavior brings its own, and nothing in this package changes:
`fbql_behaviors.observation_loading` finds it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import asin, atan2, hypot, pi
from typing import NamedTuple

from fbql_common.core.errors import BadInput
from fbql_common.core.geometry import (
    DETOUR_GAIN,
    DETOUR_RADIUS_M,
    approach_angle,
    ball_distance_and_bearing,
    wall_distance_and_bearing,
    wrap_bearing,
)
from fbql_common.core.types import World

Sense = Callable[[World], tuple[float, ...]]
Law = Callable[[Sequence[float]], tuple[float, float]]
"""A scripted instructor: from an observation to wheel velocities, left and right [rad/s]."""


class Feature(NamedTuple):
    """One number that a behavior senses, and its root range [low, high) in its unit."""

    name: str
    unit: str
    low: float
    high: float


@dataclass(frozen=True)
class Observation:
    """The features of a behavior and the function that senses them, in the same order."""

    features: tuple[Feature, ...]
    sense: Sense
    instructor: Law | None = None
    """The law that demonstrates the behavior; None where only a person can."""

    def contains(self, observed: Sequence[float]) -> bool:
        """Whether an observation lies inside the root region, where the behavior is defined."""
        return all(feature.low <= value < feature.high for feature, value in zip(self.features, observed, strict=True))


DISTANCE_M = 3.2
"""Root range of the ball's distance [m]: above the field's diagonal, and its halves 1.6, 0.8, ... 0.05 suit the task."""
WALL_DISTANCE_M = 0.96
"""Root range of the wall's distance [m]: above half the field's width; halves 0.48, 0.24, 0.12, 0.06."""


def approaching(world: World) -> tuple[float, float]:
    """Heading error towards the detour round the ball, and psi, the approach direction of Fig. 8 [rad].

    psi is the angle from the line robot -> ball to the line ball -> goal; at 0, driving at the ball pushes it towards the
    goal. Otherwise the robot must first come round behind the ball: the detour leads off the line to the ball by
    `DETOUR_GAIN * psi`, but no farther than the tangent to a circle round the ball (inside the circle: beyond the
    tangent, so that the robot leaves it). The heading error is the bearing of that direction.
    """
    dx, dy = world.ball_x_m - world.robot_x_m, world.ball_y_m - world.robot_y_m
    psi = approach_angle(world)
    nearness = DETOUR_RADIUS_M / (hypot(dx, dy) + 1e-9)
    tangent = asin(nearness) if nearness < 1.0 else pi / 2 * min(nearness, 1.5)
    detour = DETOUR_GAIN * psi
    if detour > tangent:
        detour = tangent
    elif detour < -tangent:
        detour = -tangent
    return wrap_bearing(atan2(dy, dx) - detour - world.robot_yaw_rad), psi


_BEARING = (-pi, pi)

OBSERVATIONS: dict[str, Observation] = {
    "ball_seeking": Observation(
        (Feature("ball_distance", "m", 0.0, DISTANCE_M), Feature("ball_bearing", "rad", *_BEARING)),
        ball_distance_and_bearing,
    ),
    "wall_avoiding": Observation(
        (Feature("wall_distance", "m", 0.0, WALL_DISTANCE_M), Feature("wall_bearing", "rad", *_BEARING)),
        wall_distance_and_bearing,
    ),
    "approaching": Observation(
        (Feature("detour_heading_error", "rad", *_BEARING), Feature("approach_angle", "rad", *_BEARING)), approaching
    ),
}
"""Behavior name -> its observation."""
_SHIPPED = frozenset(OBSERVATIONS)


def register(behavior: str, observation: Observation) -> None:
    """Registers the observation of a new behavior. One that was registered under this name before is replaced.

    Raises BadInput when this package has another observation of that name.
    """
    if behavior in _SHIPPED and OBSERVATIONS[behavior] != observation:
        raise BadInput(f"behavior '{behavior}': this package has an observation of that name; choose another name")
    OBSERVATIONS[behavior] = observation


def observation_of(behavior: str) -> Observation:
    """The observation of a behavior. Raises BadInput, listing the known ones, when there is none."""
    try:
        return OBSERVATIONS[behavior]
    except KeyError:
        raise BadInput(f"unknown behavior '{behavior}'; known are: {', '.join(sorted(OBSERVATIONS))}") from None
