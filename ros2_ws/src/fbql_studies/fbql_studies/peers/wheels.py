"""The raw wheels, made easier to learn from: the world seen from the robot, and a reward for progress."""

from __future__ import annotations

from math import cos, hypot, sin
from typing import Any

import gymnasium
import numpy as np
from fbql_common.core.field import FIELD
from fbql_common.core.types import World
from fbql_sim.gymnasium_env import WheelsEnv
from numpy.typing import NDArray

TOP_SPEED_M_S, TOP_YAW_RATE_RAD_S = 1.76, 50.0
GOAL_DISTANCE_WEIGHT, BALL_DISTANCE_WEIGHT = 10.0, 4.0
"""Reward for each meter by which the ball gets nearer to the goal, and the robot to the ball."""


class SeenFromRobot(gymnasium.ObservationWrapper[NDArray[np.float32], Any, Any]):
    """The whole world in the robot's frame, angles as sine and cosine, all of the order of 1: easier to learn from than poses.

    Float32 [18]: ball, its velocity, goal and closest wall point (x ahead, y to the left); speed, yaw rate; the robot's
    position, yaw; the ball's position.
    """

    def __init__(self, env: gymnasium.Env[Any, Any]) -> None:
        super().__init__(env)
        self.observation_space = gymnasium.spaces.Box(-20.0, 20.0, (18,), np.float32)

    def observation(self, observation: Any) -> NDArray[np.float32]:
        """Of the environment's latest world."""
        world: World = self.unwrapped.world  # type: ignore[attr-defined]  # it wraps a WheelsEnv
        cosine, sine = cos(world.robot_yaw_rad), sin(world.robot_yaw_rad)

        def turned(x: float, y: float) -> tuple[float, float]:
            return x * cosine + y * sine, y * cosine - x * sine

        def at(x: float, y: float) -> tuple[float, float]:
            return turned(x - world.robot_x_m, y - world.robot_y_m)

        seen = (
            *at(world.ball_x_m, world.ball_y_m),
            *turned(world.ball_vx_m_s, world.ball_vy_m_s),
            *at(FIELD.half_length_m, 0.0),
            *at(world.wall_x_m, world.wall_y_m),
            world.robot_speed_m_s / TOP_SPEED_M_S,
            world.robot_yaw_rate_rad_s / TOP_YAW_RATE_RAD_S,
            world.robot_x_m,
            world.robot_y_m,
            cosine,
            sine,
            world.ball_x_m,
            world.ball_y_m,
            hypot(world.ball_x_m - world.robot_x_m, world.ball_y_m - world.robot_y_m),
            hypot(FIELD.half_length_m - world.ball_x_m, world.ball_y_m),
        )
        return np.array(seen, np.float32)


class Shaped(gymnasium.Wrapper[Any, Any, Any, Any]):
    """Adds Phi(s') - Phi(s) to the reward: progress of the ball to the goal and of the robot to the ball.

    Phi is minus the two distances, weighted. With a discount, gamma Phi(s') - Phi(s), the best policy would stay what it is
    (Ng, Harada & Russell, Policy invariance under reward transformations, 1999), but standing still far away would be paid
    (1 - gamma) |Phi| at every decision, and with it PPO learned to stand still.
    """

    def __init__(self, env: gymnasium.Env[Any, Any]) -> None:
        super().__init__(env)
        self._potential = 0.0

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begins an episode."""
        begun = self.env.reset(seed=seed, options=options)
        self._potential = self.potential()
        return begun

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """One step, with the reward of the potential's change."""
        observation, reward, terminated, truncated, info = self.env.step(action)
        before, self._potential = self._potential, self.potential()
        return observation, float(reward) + self._potential - before, terminated, truncated, info

    def potential(self) -> float:
        """Phi of the environment's latest world."""
        world: World = self.unwrapped.world  # type: ignore[attr-defined]  # it wraps a WheelsEnv
        to_goal = hypot(FIELD.half_length_m - world.ball_x_m, world.ball_y_m)
        to_ball = hypot(world.ball_x_m - world.robot_x_m, world.ball_y_m - world.robot_y_m)
        return -GOAL_DISTANCE_WEIGHT * to_goal - BALL_DISTANCE_WEIGHT * to_ball


def wheels_env(hold_steps: int, shaped: bool = False, **more: Any) -> gymnasium.Env[Any, Any]:
    """The environment of the raw wheels, seen from the robot, and, if shaped, with a reward for progress."""
    env: gymnasium.Env[Any, Any] = SeenFromRobot(WheelsEnv(hold_steps=hold_steps, **more))
    return Shaped(env) if shaped else env
