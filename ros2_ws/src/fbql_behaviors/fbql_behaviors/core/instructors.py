"""Scripted instructors: laws that drive well, and a hand that drives like a person.

A law maps an observation to wheel velocities [rad/s]. A `Hand` follows a law as a person would: with a reaction lag, wheel
gains that differ from one demonstration to the next, and smooth noise. It is causal: a command depends only on the
observations so far and on the generator passed in.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from math import cos, pi, sqrt
from typing import NamedTuple

import numpy as np
from fbql_common.core.errors import BadInput
from fbql_common.core.field import MAX_WHEEL_RAD_S
from fbql_common.core.geometry import wrap_angle

from fbql_behaviors.core.observation import OBSERVATIONS, Law
from fbql_behaviors.core.quantizer import LEVEL_RAD_S

NEAR_WALL_M = 0.2
"""Distance below which the instructor reacts to a wall [m]."""
HEAD_ON_RAD = 1.3
"""Bearing of a wall below which the instructor backs away [rad]."""


class Steering(NamedTuple):
    """How an instructor steers to a direction."""

    most_turn_rad_s: float = 18.0
    """What one wheel gains and the other loses where the heading is off by `full_turn_rad` or more."""
    full_turn_rad: float = 1.0
    reverses: bool = False
    """Drives backwards where that is the smaller turn."""

    def towards(self, error_rad: float, speed_rad_s: float) -> tuple[float, float]:
        """Wheel velocities [rad/s] for a heading error [rad], the slower the larger the error."""
        if self.reverses and abs(error_rad) > pi / 2:
            error_rad, speed_rad_s = wrap_angle(error_rad + pi), -speed_rad_s
        turn = self.most_turn_rad_s * min(max(error_rad / self.full_turn_rad, -1.0), 1.0)
        forward = speed_rad_s * max(cos(error_rad), 0.0)
        return forward - turn, forward + turn


FORWARDS = Steering()
"""How the shipped demonstrations were driven."""
AGILE = Steering(25.0, 0.5, reverses=True)
"""Steers harder, and drives backwards too: see the study `limits`."""


def seek_ball(observation: Sequence[float], steering: Steering = FORWARDS) -> tuple[float, float]:
    """Turns to the ball and drives at it, faster the more directly it is ahead."""
    _, bearing = observation
    return steering.towards(bearing, 65.0)


def avoid_wall(observation: Sequence[float]) -> tuple[float, float]:
    """Backs away from a wall ahead while turning, steers away from one beside, drives away from one behind."""
    distance, bearing = observation
    if distance > NEAR_WALL_M:
        return 50.0, 50.0
    side = 1.0 if bearing >= 0.0 else -1.0
    if abs(bearing) < HEAD_ON_RAD:
        forward, turn = -30.0, -25.0 * side
    elif abs(bearing) < pi / 2:
        forward, turn = 25.0, -30.0 * side
    else:
        forward, turn = 55.0, 0.0
    return forward - turn, forward + turn


def approach(observation: Sequence[float], steering: Steering = FORWARDS) -> tuple[float, float]:
    """Steers along the detour round the ball; faster when the push will go towards the goal (psi near 0)."""
    error, psi = observation
    return steering.towards(error, 50.0 + 20.0 * max(0.0, 1.0 - abs(psi) / 0.8))


@dataclass(frozen=True)
class Habits:
    """The imperfections of a person's driving."""

    lag_steps: int = 2
    """Reaction lag [steps]."""
    imprecision: float = 0.08
    """Standard deviation of the wheels' gains from one demonstration to the next [1]."""
    noise_rad_s: float = 0.5 * LEVEL_RAD_S
    """Standard deviation of the noise on each wheel [rad/s]."""
    smoothness: float = 0.9
    """Share of the noise carried over to the next step [1]."""


INSTRUCTORS: dict[str, Law] = {"ball_seeking": seek_ball, "wall_avoiding": avoid_wall, "approaching": approach}
"""Behavior name -> the law of its scripted instructor. A new behavior declares it in its `Observation`."""


def instructor_of(behavior: str) -> Law:
    """The law of a behavior's scripted instructor. Raises BadInput, listing those that have one, when there is none."""
    observation = OBSERVATIONS.get(behavior)
    law = (observation.instructor if observation else None) or INSTRUCTORS.get(behavior)
    if law is None:
        raise BadInput(
            f"behavior '{behavior}' has no scripted instructor; there is one for: {', '.join(sorted(INSTRUCTORS))}"
        )
    return law


class Hand:
    """The driver of one demonstration."""

    def __init__(self, law: Law, habits: Habits, rng: np.random.Generator) -> None:
        self._law = law
        self._habits = habits
        self._rng = rng
        self._seen: deque[Sequence[float]] = deque(maxlen=habits.lag_steps + 1)
        self._gain_left, self._gain_right = (1.0 + habits.imprecision * rng.standard_normal(2)).tolist()
        self._noise_left, self._noise_right = (habits.noise_rad_s * rng.standard_normal(2)).tolist()

    def command(self, observation: Sequence[float]) -> tuple[float, float]:
        """Wheel velocities [rad/s]. The law answers the observation of `lag_steps` ago, or the first one."""
        self._seen.append(observation)
        left, right = self._law(self._seen[0])
        habits = self._habits
        fresh = habits.noise_rad_s * sqrt(1.0 - habits.smoothness**2)
        draw_left, draw_right = self._rng.standard_normal(2).tolist()
        self._noise_left = habits.smoothness * self._noise_left + fresh * draw_left
        self._noise_right = habits.smoothness * self._noise_right + fresh * draw_right
        return (
            _within_full(left * self._gain_left + self._noise_left),
            _within_full(right * self._gain_right + self._noise_right),
        )


def _within_full(wheel_rad_s: float) -> float:
    return min(max(wheel_rad_s, -MAX_WHEEL_RAD_S), MAX_WHEEL_RAD_S)
