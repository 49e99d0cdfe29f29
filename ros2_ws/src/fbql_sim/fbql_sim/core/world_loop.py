"""The loop that composes physics and task into a sequence of worlds."""

from __future__ import annotations

from math import isfinite

from fbql_common.core.types import World, made_of
from fbql_common.core.walls import closest_wall_point

from fbql_sim.core.measurement import Measurement
from fbql_sim.core.parameters import SimulationParameters
from fbql_sim.core.physics import Physics, Start
from fbql_sim.core.task import NO_EVENTS, Events, Task


class WorldLoop:
    """Plays episodes: `reset` returns the first world, each `step` the next one, until one has ended.

    The same seed and commands give the same worlds bit for bit (but for `stamp_ns` and `episode`), regardless of what
    was played before. `stamp_ns` is k·dt for the k-th world this loop has produced, from 1 on: simulated time never
    goes back, and is never 0. Goals and collisions are those of the true state, everything else of a world is measured.
    """

    def __init__(self, parameters: SimulationParameters | None = None, worlds: int = 0) -> None:
        """`worlds`: how many a loop before this one has produced, whose `stamp_ns` this one continues."""
        parameters = parameters or SimulationParameters()
        self.dt_s = parameters.dt_s
        self._physics = Physics(parameters)
        self._task = Task(parameters)
        self._measurement = Measurement(parameters)
        self._world: World | None = None
        self._worlds = worlds
        self._episode = 0
        self._step = 0

    @property
    def world(self) -> World:
        """The latest world. Raises RuntimeError before the first reset."""
        if self._world is None:
            raise RuntimeError("no episode has begun: call reset first")
        return self._world

    def reset(self, episode: int, seed: int) -> World:
        """Begins an episode and returns its world of step 0. Raises ValueError for a negative seed."""
        self._physics.reset(self._task.begin(seed))
        self._measurement.begin(seed)
        self._episode, self._step = episode, 0
        return self._observe(NO_EVENTS)

    def resume(self, world: World) -> World:
        """Goes on from a world, which may be another loop's, and returns it as the first world of an episode.

        What a world does not hold is as after `reset` with seed 0: the gains of the wheels and their noise, delayed
        commands, sideways slip and the ball's spin.
        """
        self._task.begin(0)
        self._measurement.begin(0)
        self._physics.reset(Start(*(getattr(world, name) for name in Start._fields)))
        self._episode, self._step = world.episode, 0
        return self._observe(NO_EVENTS)

    def step(self, left_rad_s: float, right_rad_s: float) -> World:
        """Drives the wheels for one step [rad/s] and returns the next world.

        Raises:
            ValueError: a wheel velocity is not finite; nothing has moved.
            RuntimeError: no episode is running (before the first reset, or after an ended world).
        """
        world = self._world or self.world  # the property raises where there is none
        if world.terminated or world.truncated:
            raise RuntimeError(f"episode {world.episode} ended at step {world.step}: call reset first")
        if not (isfinite(left_rad_s) and isfinite(right_rad_s)):
            raise ValueError(f"wheel velocities must be finite, not ({left_rad_s}, {right_rad_s}) rad/s")
        physics, task = self._physics, self._task
        left, right = task.disturb(left_rad_s, right_rad_s)
        physics.step(left, right)
        self._step += 1
        return self._observe(task.judge(physics.ball_x_m, physics.ball_y_m, physics.robot_touched_wall))

    def _observe(self, events: Events) -> World:
        physics = self._physics
        self._worlds += 1
        x, y = physics.robot_x_m, physics.robot_y_m
        wall_x, wall_y, wall_yaw = closest_wall_point(x, y)
        values = (
            round(self._worlds * self.dt_s * 1e9),
            self._episode,
            self._step,
            x,
            y,
            physics.robot_yaw_rad,
            physics.robot_speed_m_s,
            physics.robot_yaw_rate_rad_s,
            physics.ball_x_m,
            physics.ball_y_m,
            physics.ball_vx_m_s,
            physics.ball_vy_m_s,
            wall_x,
            wall_y,
            wall_yaw,
            *events,
        )
        world = made_of(World, values)
        self._world = world = world if self._measurement.is_exact else self._measurement.of(world)
        return world
