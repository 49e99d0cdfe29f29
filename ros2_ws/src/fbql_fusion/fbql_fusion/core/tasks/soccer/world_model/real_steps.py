"""The real steps that the model is fitted to: the latest whole episodes, rounded to float32 as they are stored.

Memory and time of a fit are bounded: when more than `capacity` steps are kept, the oldest episodes are dropped.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from fbql_common.core.errors import BadInput
from fbql_common.core.types import World
from numpy.typing import NDArray

from fbql_fusion.core.learners.linear import Floats
from fbql_fusion.core.learners.policy_arrays import check_arrays, check_range, rows_of

Floats32 = NDArray[np.float32]

STATE = ("robot x", "robot y", "robot yaw", "robot speed", "robot yaw rate", "ball x", "ball y", "ball vx", "ball vy")
"""The components of a state [m, rad, m/s, rad/s], in the frame `field`."""
_BEGINS, _TOUCHES, _COLLIDES = 1, 2, 4
"""The bits of a mark."""


def state_of(world: World) -> tuple[float, ...]:
    """The state of a world, see STATE."""
    return (
        world.robot_x_m,
        world.robot_y_m,
        world.robot_yaw_rad,
        world.robot_speed_m_s,
        world.robot_yaw_rate_rad_s,
        world.ball_x_m,
        world.ball_y_m,
        world.ball_vx_m_s,
        world.ball_vy_m_s,
    )


class Transitions(NamedTuple):
    """N real steps."""

    before: Floats
    """[N, 9]"""
    commands: Floats
    """Left and right [rad/s], [N, 2]."""
    after: Floats
    """[N, 9]"""
    touched: Floats
    """1 where the robot touched a wall in the step, else 0, [N]."""
    collides: NDArray[np.bool_]
    """Whether a collision began in the step, [N]."""
    episode: NDArray[np.int64]
    """The episode of each, counted from the oldest one that is kept, [N]."""


class RealSteps:
    """The real steps so far, in order.

    Args:
        capacity: steps that are kept; the latest episode is kept whole even if it is longer.
    """

    def __init__(self, capacity: int) -> None:
        self._capacity = capacity
        self._states: Floats32 = np.empty((1024, len(STATE)), dtype=np.float32)
        self._commands: Floats32 = np.empty((1024, 2), dtype=np.float32)
        self._marks: NDArray[np.int32] = np.empty(1024, dtype=np.int32)
        self._rows = 0
        """Of whole episodes."""
        self._open = 0
        """Rows of the unfinished episode, after them."""

    def __len__(self) -> int:
        """Steps of the whole episodes that are kept."""
        return self._rows - int((self._marks[: self._rows] & _BEGINS).sum())

    def begin(self, world: World) -> None:
        """Begins an episode in its first world. One that has not ended is dropped."""
        self._open = 0
        self._append(world, 0.0, 0.0, _BEGINS)

    def add(self, left_rad_s: float, right_rad_s: float, world: World) -> None:
        """Adds the step that a command caused and the world that it led to; if that ended the episode, it now counts."""
        if not self._open:
            return
        self._append(world, left_rad_s, right_rad_s, _TOUCHES * world.collision + _COLLIDES * world.collision_begun)
        if world.ended:
            self._rows, self._open = self._rows + self._open, 0
            self._drop_oldest()

    def forget_episode(self) -> None:
        """Drops the episode in progress: a step of it is missing."""
        self._open = 0

    def transitions(self) -> Transitions:
        """The steps of the whole episodes."""
        states = self._states[: self._rows].astype(np.float64)
        marks = self._marks[: self._rows]
        follows = np.flatnonzero(marks & _BEGINS == 0)
        return Transitions(
            states[follows - 1],
            self._commands[follows].astype(np.float64),
            states[follows],
            (marks[follows] & _TOUCHES != 0).astype(np.float64),
            marks[follows] & _COLLIDES != 0,
            np.cumsum(marks & _BEGINS)[follows] - 1,
        )

    def starts(self) -> Floats:
        """The states that the whole episodes began in, [E, 9]."""
        return self._states[: self._rows][self._marks[: self._rows] & _BEGINS != 0].astype(np.float64)

    def to_arrays(self) -> dict[str, NDArray[Any]]:
        """The whole episodes: real_states float32 [R, 9], real_commands float32 [R, 2], real_marks int32 [R]."""
        return {
            "real_states": self._states[: self._rows].copy(),
            "real_commands": self._commands[: self._rows].copy(),
            "real_marks": self._marks[: self._rows].copy(),
        }

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray[Any]], capacity: int) -> RealSteps:
        """What `to_arrays` returned. Raises BadInput for arrays that can't come from it."""
        rows = rows_of(arrays, "real_marks")
        shapes = {
            "real_states": ("s", (rows, len(STATE))),
            "real_commands": ("s", (rows, 2)),
            "real_marks": ("l", (rows,)),
        }
        check_arrays(arrays, shapes)
        check_range(arrays, "real_marks", 0, _BEGINS | _TOUCHES | _COLLIDES)
        steps = cls(capacity)
        marks = arrays["real_marks"]
        if rows and not (
            marks[0] & _BEGINS and not marks[-1] & _BEGINS and not (marks[:-1] & marks[1:] & _BEGINS).any()
        ):
            raise BadInput("the policy's array 'real_marks' has an episode without a step")
        for mine, name in (("_states", "real_states"), ("_commands", "real_commands"), ("_marks", "real_marks")):
            if rows:
                setattr(steps, mine, arrays[name].copy())
        steps._rows = rows
        steps._drop_oldest()
        return steps

    def _append(self, world: World, left_rad_s: float, right_rad_s: float, mark: int) -> None:
        at = self._rows + self._open
        if at == len(self._marks):
            self._states = np.concatenate([self._states, np.empty_like(self._states)])
            self._commands = np.concatenate([self._commands, np.empty_like(self._commands)])
            self._marks = np.concatenate([self._marks, np.empty_like(self._marks)])
        self._states[at] = state_of(world)
        self._commands[at] = left_rad_s, right_rad_s
        self._marks[at] = mark
        self._open += 1

    def _drop_oldest(self) -> None:
        """Drops the oldest episodes until no more than the capacity is kept, but never the latest."""
        begins = np.flatnonzero(self._marks[: self._rows] & _BEGINS)
        later = self._rows - begins - np.arange(len(begins), 0, -1)  # steps from each episode on
        kept = np.flatnonzero(later <= self._capacity)
        first = int(begins[kept[0]]) if len(kept) else int(begins[-1]) if len(begins) else 0
        if first:
            for each in (self._states, self._commands, self._marks):
                each[: self._rows - first] = each[first : self._rows].copy()
            self._rows -= first
