"""What is measured of robot and ball: their state, with the errors of sensors."""

from __future__ import annotations

import numpy as np
from fbql_common.core.geometry import wrap_angle
from fbql_common.core.types import World
from fbql_common.core.walls import closest_wall_point

from fbql_sim.core.parameters import SimulationParameters

_STREAM = 1
"""Distinguishes the errors' random numbers from those of the task, which they leave as they are."""


class Measurement:
    """Adds independent normal errors to what a world has of robot and ball; the seed of an episode decides them."""

    def __init__(self, parameters: SimulationParameters) -> None:
        position, speed = parameters.position_noise_m, parameters.speed_noise_m_s
        yaw, yaw_rate = parameters.yaw_noise_rad, parameters.yaw_rate_noise_rad_s
        self._deviations = np.array([position, position, yaw, speed, yaw_rate, position, position, speed, speed])
        self.is_exact = not self._deviations.any()
        """Whether nothing is added."""
        self.begin(0)

    def begin(self, seed: int) -> None:
        """Begins an episode."""
        if not self.is_exact:
            self._rng = np.random.default_rng([seed, _STREAM])

    def of(self, world: World) -> World:
        """What is measured of a world. The closest wall point is that of the measured place."""
        errors: list[float] = (self._deviations * self._rng.standard_normal(len(self._deviations))).tolist()
        x, y = world.robot_x_m + errors[0], world.robot_y_m + errors[1]
        wall_x, wall_y, wall_yaw = closest_wall_point(x, y)
        return world._replace(
            robot_x_m=x,
            robot_y_m=y,
            robot_yaw_rad=wrap_angle(world.robot_yaw_rad + errors[2]),
            robot_speed_m_s=world.robot_speed_m_s + errors[3],
            robot_yaw_rate_rad_s=world.robot_yaw_rate_rad_s + errors[4],
            ball_x_m=world.ball_x_m + errors[5],
            ball_y_m=world.ball_y_m + errors[6],
            ball_vx_m_s=world.ball_vx_m_s + errors[7],
            ball_vy_m_s=world.ball_vy_m_s + errors[8],
            wall_x_m=wall_x,
            wall_y_m=wall_y,
            wall_yaw_rad=wall_yaw,
        )
