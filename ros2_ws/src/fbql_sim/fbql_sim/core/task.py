"""The task: starts, the delay of commands, wheel disturbance, events, and the end of an episode."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from fbql_common.core.errors import BadInput
from fbql_common.core.field import BALL_RADIUS_M, FIELD, FREE_BALL_SPOTS_M

from fbql_sim.core.parameters import SimulationParameters
from fbql_sim.core.physics import Start

GOAL_X_M = FIELD.half_length_m + BALL_RADIUS_M
"""|x| from which the whole ball is past a goal line [m] (FIRA Law: "the whole of the ball passes over")."""
NOISE_BLOCK = 256
"""Steps whose noise is drawn at once: a draw takes microseconds, whatever its size."""


class Events(NamedTuple):
    """The events that a step caused; the names are those of World."""

    goal: bool
    own_goal: bool
    collision_begun: bool
    collision: bool
    terminated: bool
    truncated: bool


NO_EVENTS = Events(False, False, False, False, False, False)


class Task:
    """Score with a ball on a free-ball spot, starting in front of the own goal; one seed decides everything random."""

    def __init__(self, parameters: SimulationParameters) -> None:
        if parameters.start_distance_low_m > parameters.start_distance_high_m:
            raise BadInput(
                f"start_distance_low_m {parameters.start_distance_low_m} is above "
                f"start_distance_high_m {parameters.start_distance_high_m}: make it the smaller one"
            )
        self._parameters = parameters
        self._gap_steps = round(parameters.collision_gap_s / parameters.dt_s)
        self._delay_steps = round(parameters.command_delay_s / parameters.dt_s)
        self._max_steps = parameters.max_steps
        self.begin(0)

    def begin(self, seed: int) -> Start:
        """Begins an episode: draws its start and the gains of its wheels."""
        parameters = self._parameters
        rng = np.random.default_rng(seed)
        spot_x, spot_y = FREE_BALL_SPOTS_M[int(rng.integers(len(FREE_BALL_SPOTS_M)))]
        distance = float(rng.uniform(parameters.start_distance_low_m, parameters.start_distance_high_m))
        y, yaw, ball_x, ball_y = rng.uniform(-1.0, 1.0, size=4).tolist()
        self._steps = 0
        self._steps_since_contact = self._gap_steps
        self._gains = self._draw_gains(rng)
        self._delayed = deque([(0.0, 0.0)] * self._delay_steps)
        return Start(
            robot_x_m=distance - FIELD.half_length_m,
            robot_y_m=y * parameters.start_robot_y_jitter_m,
            robot_yaw_rad=yaw * parameters.start_yaw_jitter_rad,
            ball_x_m=spot_x + ball_x * parameters.start_ball_jitter_m,
            ball_y_m=spot_y + ball_y * parameters.start_ball_jitter_m,
        )

    def disturb(self, left_rad_s: float, right_rad_s: float) -> tuple[float, float]:
        """The wheel velocities that a command causes [rad/s]: each wheel has a gain, with noise from step to step.

        Where commands are delayed, they are those of an earlier command.
        """
        if self._delay_steps:
            self._delayed.append((left_rad_s, right_rad_s))
            left_rad_s, right_rad_s = self._delayed.popleft()
        left_gain, right_gain = next(self._gains)
        return left_rad_s * left_gain, right_rad_s * right_gain

    def judge(self, ball_x_m: float, ball_y_m: float, touched_wall: bool) -> Events:
        """The events of the latest step, from the ball's position [m] and the robot's contact with a wall.

        A collision begins with the first contact after at least `collision_gap_s` without one.
        """
        self._steps += 1
        begun = False
        if touched_wall:
            begun = self._steps_since_contact >= self._gap_steps
            self._steps_since_contact = 0
        else:
            self._steps_since_contact += 1
        goal = own_goal = False
        if not -GOAL_X_M < ball_x_m < GOAL_X_M and abs(ball_y_m) < FIELD.half_goal_m:
            goal, own_goal = ball_x_m > 0.0, ball_x_m < 0.0
        terminated = goal or own_goal
        truncated = not terminated and self._steps >= self._max_steps
        if not (touched_wall or terminated or truncated):
            return NO_EVENTS
        return Events(goal, own_goal, begun, touched_wall, terminated, truncated)

    def _draw_gains(self, rng: np.random.Generator) -> Iterator[list[float]]:
        parameters = self._parameters
        gain = 1.0 + parameters.wheel_gain_deviation * rng.standard_normal(2)
        while True:
            noise = parameters.wheel_noise_deviation * rng.standard_normal((NOISE_BLOCK, 2))
            yield from (gain * (1.0 + noise)).tolist()
