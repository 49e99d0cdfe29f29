"""The simulator as a Gymnasium environment: wheel velocities in, the whole world out.

    import gymnasium
    import fbql_sim.gymnasium_env  # registers the environment

    env = gymnasium.make("fbql/Wheels-v0", reward_collision=-0.3)

Gymnasium is an optional extra (`fbql_sim[gymnasium]`); nothing else in this package needs it. The world underneath is
the one of the nodes, `fbql_sim.core.world_loop.WorldLoop`: the same seed and commands give the same episode.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from math import inf, isfinite, pi
from typing import Any

import numpy as np
from fbql_common.core.errors import BadInput
from fbql_common.core.field import FIELD, MAX_WHEEL_RAD_S
from fbql_common.core.parameters import from_mapping, limits_of, parameter, types_of
from fbql_common.core.text import quoted
from fbql_common.core.types import World
from fbql_common.core.walls import POCKET
from numpy.typing import NDArray

from fbql_sim.core.parameters import SimulationParameters
from fbql_sim.core.world_loop import WorldLoop

try:
    import gymnasium
except ModuleNotFoundError as error:
    if error.name != "gymnasium":
        raise
    raise ModuleNotFoundError(
        "fbql_sim.gymnasium_env needs Gymnasium, which is an optional extra: pip install gymnasium", name="gymnasium"
    ) from None

WHEELS_ID = "fbql/Wheels-v0"

Drive = Callable[[World], tuple[float, float]]
"""Wheel velocities for a world, left and right [rad/s]."""

_X_M, _Y_M = POCKET + 0.05, FIELD.half_width_m + 0.05
OBSERVED: dict[str, float] = {
    "robot_x_m": _X_M,
    "robot_y_m": _Y_M,
    "robot_yaw_rad": pi,
    "robot_speed_m_s": 5.0,
    "robot_yaw_rate_rad_s": 100.0,
    "ball_x_m": _X_M,
    "ball_y_m": _Y_M,
    "ball_vx_m_s": 20.0,
    "ball_vy_m_s": 20.0,
    "wall_x_m": _X_M,
    "wall_y_m": _Y_M,
    "wall_yaw_rad": pi,
}
"""The observed fields of World, in order, and the largest absolute value of each; SI units and radians, in the frame
"field" (REP-103: x towards the attacked goal, y to the left, counter-clockwise positive)."""
_FIRST, _END = World._fields.index("robot_x_m"), World._fields.index("wall_yaw_rad") + 1
_HIGH = np.array([*OBSERVED.values()], np.float32)


@dataclass(frozen=True)
class EnvironmentParameters:
    """Parameters of an environment beside the simulator's own."""

    hold_steps: int = parameter(1, "steps of the simulator that an action is held for", low=1, high=100_000)
    reward_goal: float = parameter(10.0, "reward of a goal", low=-1e9, high=1e9)
    reward_own_goal: float = parameter(-10.0, "reward of an own goal", low=-1e9, high=1e9)
    reward_collision: float = parameter(-5.0, "reward of a collision, once when it begins", low=-1e9, high=1e9)


@dataclass
class _Course:
    """An episode so far: what it takes to play it again."""

    worlds: int = 0
    """Worlds produced up to its first one."""
    seed: int | None = None
    """None before the first episode."""
    commands: list[tuple[float, float]] = field(default_factory=list[tuple[float, float]])


class WheelsEnv(gymnasium.Env[NDArray[np.float32], Any]):
    """Score with a differential-drive robot by commanding its wheel velocities.

    Action: float32 [2], left and right wheel velocity as a share of MAX_WHEEL_RAD_S (88 rad/s), clipped to -1 .. 1.
    Observation: float32 [12], the fields of OBSERVED, clipped to its bounds.
    Reward: the sum over the held steps of the rewards of a goal, an own goal, and each collision that begins.
    Terminated by a goal or an own goal; truncated after `max_steps` (4000) steps of the simulator. Never both.
    Info of a step: `steps` (of the simulator), `goal`, `own_goal`, `collisions_begun`, `collision_steps`; of a reset:
    `episode_seed`.

    `reset(seed=S)` begins a sequence of episodes determined by S alone. `reset(options={"episode_seed": N})` plays the same
    episode as seed N does in a session: the same start, the same disturbance of the wheels.

    An environment can be pickled and copied with `copy.deepcopy`, within an episode as well: the copy plays the episode's
    commands again, and continues bit for bit as the original.

    To build another action or observation on the same world, override `driver`, `observe` and the two spaces.

    Args:
        render_mode: None; `gymnasium.make` and others pass it on.
        parameters: those of EnvironmentParameters and of SimulationParameters, by name.

    Raises:
        BadInput: an unknown parameter, a value of a wrong type or out of range, or a render mode.
    """

    metadata = {"render_modes": []}  # noqa: RUF012 - Gymnasium's own declaration

    def __init__(self, *, render_mode: str | None = None, **parameters: Any) -> None:
        if render_mode is not None:
            raise BadInput(
                f"environment: render_mode is {quoted(render_mode)}, but there is no rendering: omit it, or pass None"
            )
        self.render_mode = None
        values = {name: parameters.pop(name) for name in limits_of(EnvironmentParameters) if name in parameters}
        self.parameters = _declared(EnvironmentParameters, values)
        self.simulation = _declared(SimulationParameters, parameters)
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (2,), np.float32)
        self.observation_space = gymnasium.spaces.Box(-_HIGH, _HIGH, dtype=np.float32)
        self._loop = WorldLoop(self.simulation)
        self._episode = -1
        self._course = _Course()

    @property
    def world(self) -> World:
        """The latest world. Raises RuntimeError before the first reset."""
        return self._loop.world

    def driver(self, action: Any) -> Drive:
        """The function that drives while an action is held: here the same wheel velocities for every world."""
        left, right = numbers_of(action, 2)
        command = _clip(left) * MAX_WHEEL_RAD_S, _clip(right) * MAX_WHEEL_RAD_S
        return lambda _world: command

    def observe(self, world: World) -> NDArray[np.float32]:
        """The observation of a world."""
        seen = np.array(world[_FIRST:_END], np.float32)
        np.maximum(seen, -_HIGH, out=seen)
        return np.minimum(seen, _HIGH, out=seen)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begins an episode. Raises BadInput for options that can't be used."""
        episode_seed = _episode_seed({} if options is None else options)
        super().reset(seed=seed)
        if episode_seed is None:
            episode_seed = int(self.np_random.integers(2**63))
        self._episode += 1
        self._course = _Course(self._course.worlds + 1 + len(self._course.commands), episode_seed)
        return self.observe(self._loop.reset(self._episode, episode_seed)), {"episode_seed": episode_seed}

    def step(self, action: Any) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Holds an action for `hold_steps` steps, or until the episode ends.

        Raises:
            ValueError: the action is not two finite numbers; nothing has moved.
            RuntimeError: no episode is running: `reset` was not called, or not since the end of the last episode.
        """
        world, advance, commands = self._running(), self._loop.step, self._course.commands
        drive = self.driver(action)
        parameters = self.parameters
        reward = 0.0
        steps = begun = contact = 0
        for _ in range(parameters.hold_steps):
            command = drive(world)
            world = advance(*command)
            commands.append(command)
            steps += 1
            if world.collision:
                contact += 1
                if world.collision_begun:
                    begun += 1
                    reward += parameters.reward_collision
            if world.terminated or world.truncated:
                break
        if world.goal:
            reward += parameters.reward_goal
        elif world.own_goal:
            reward += parameters.reward_own_goal
        info = {
            "steps": steps,
            "goal": world.goal,
            "own_goal": world.own_goal,
            "collisions_begun": begun,
            "collision_steps": contact,
        }
        return self.observe(world), reward, world.terminated, world.truncated, info

    def render(self) -> None:
        """Does nothing, because there is no rendering; Gymnasium's own `render` raises NotImplementedError."""

    def _running(self) -> World:
        """The latest world, of an episode that goes on."""
        world = self._loop.world
        if world.ended:
            raise RuntimeError(f"episode {world.episode} ended at step {world.step}: call reset first")
        return world

    def __getstate__(self) -> dict[str, Any]:
        """All but the physics, which `__setstate__` makes again: its space is an object of a C library."""
        return {name: value for name, value in self.__dict__.items() if name != "_loop"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        course = self._course
        self._loop = loop = WorldLoop(self.simulation, max(course.worlds - 1, 0))
        if course.seed is not None:
            loop.reset(self._episode, course.seed)
            for command in course.commands:
                loop.step(*command)


def numbers_of(action: Any, count: int) -> list[float]:
    """The finite numbers of an action. Raises ValueError for anything but that many finite numbers."""
    try:
        values = np.asarray(action)
    except ValueError:  # rows of different lengths
        values = np.empty(0)
    if values.shape != (count,) or values.dtype.kind not in "fiu":
        kind = f"{values.dtype} {list(values.shape)}" if values.size else " ".join(quoted(action)[:40].split())
        raise ValueError(f"an action is {count} numbers, not {kind}")
    numbers = [*map(float, values.tolist())]  # of a longdouble that is no float yet
    if not all(map(isfinite, numbers)):
        raise ValueError(f"the numbers of an action must be finite, not {numbers}")
    return numbers


def _declared[T](declaration: type[T], values: dict[str, Any]) -> T:
    """An instance of a declaration; integers are accepted for floats."""
    kinds = types_of(declaration)
    whole = {name: _float(value) for name, value in values.items() if type(value) is int and kinds.get(name) is float}
    return from_mapping(declaration, {**values, **whole}, "environment")


def _float(value: int) -> float:
    """The nearest float; an infinity, which every declaration refuses, for a number beyond all of them."""
    try:
        return float(value)
    except OverflowError:
        return inf if value > 0 else -inf


def _clip(share: float) -> float:
    """The value within -1 .. 1."""
    return 1.0 if share > 1.0 else -1.0 if share < -1.0 else share


def _episode_seed(options: Any) -> int | None:
    """The episode seed in the reset options, if any."""
    if not isinstance(options, dict):
        raise BadInput(f"environment: reset options are {quoted(options)[:40]!r}; they must be a dictionary")
    unknown = sorted(str(name) for name in set(options) - {"episode_seed"})
    if unknown:
        raise BadInput(f"environment: unknown reset option '{unknown[0]}'; known is: episode_seed")
    seed = options.get("episode_seed")
    if seed is not None and not (
        isinstance(seed, int | np.integer) and not isinstance(seed, bool) and 0 <= seed < 2**63
    ):
        raise BadInput(
            f"environment: reset option 'episode_seed' is {quoted(seed)}; it must be a whole number, 0 .. 2^63 - 1"
        )
    return None if seed is None else int(seed)


gymnasium.register(id=WHEELS_ID, entry_point="fbql_sim.gymnasium_env:WheelsEnv")
