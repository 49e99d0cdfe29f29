"""The domain types of one step. The fields are those of the messages in fbql_msgs, flat.

They are NamedTuples: immutable, compared by value, created and read in well under a microsecond.
SI units, radians, frame "field" (x towards the attacked goal, y to the left), order left, right.
"""

from __future__ import annotations

from enum import IntEnum
from operator import itemgetter
from typing import Any, NamedTuple, Protocol, cast

FIELD_FRAME = "field"
DRIVER_BLEND = -1
"""Decision.driver when no single behavior drove."""
NO_LEAF = -1
"""The entry of a joint state for a behavior that did not answer."""


class _MadeOf(Protocol):
    def __call__[T](self, kind: type[T], values: tuple[Any, ...], /) -> T: ...


made_of = cast("_MadeOf", tuple.__new__)  # pyright: ignore[reportUnknownMemberType]
"""made_of(World, values) is World(*values) in half the time, without a check of the number of values."""


class Phase(IntEnum):
    """The purpose of an episode; the numbers are the PHASE_ constants of FusionDecision."""

    GUIDED = 0
    LEARNING = 1
    EVALUATION = 2


class World(NamedTuple):
    """The world state after a step: the simulator's truth (fbql_msgs/WorldState)."""

    stamp_ns: int
    episode: int
    step: int
    robot_x_m: float
    robot_y_m: float
    robot_yaw_rad: float
    robot_speed_m_s: float
    robot_yaw_rate_rad_s: float
    ball_x_m: float
    ball_y_m: float
    ball_vx_m_s: float
    ball_vy_m_s: float
    wall_x_m: float
    wall_y_m: float
    wall_yaw_rad: float
    goal: bool
    own_goal: bool
    collision_begun: bool
    collision: bool
    terminated: bool
    truncated: bool

    @property
    def ended(self) -> bool:
        """Whether the episode ended with this world state, for either reason."""
        return self.terminated or self.truncated


class BehaviorOutput(NamedTuple):
    """One behavior's answer to a world state (fbql_msgs/BehaviorOutput)."""

    stamp_ns: int
    episode: int
    step: int
    name: str
    left_rad_s: float
    right_rad_s: float
    leaf_id: int
    leaf_count: int
    tree_hash: str
    clamped: bool
    observation: tuple[float, ...]
    active = True
    """Always: a behavior that must not drive sends no answer."""

    command = cast("tuple[float, float]", property(itemgetter(4, 5)))
    """The reference as a command in `field.WHEELS`. An itemgetter, since every step reads it several times."""


class WheelCommand(NamedTuple):
    """The fused wheel command (fbql_msgs/WheelCommand)."""

    stamp_ns: int
    episode: int
    step: int
    left_rad_s: float
    right_rad_s: float


class Decision(NamedTuple):
    """Why the wheel command is what it is (fbql_msgs/FusionDecision); arrays in the order of `behaviors`."""

    stamp_ns: int
    episode: int
    step: int
    controller: str
    phase: int
    behaviors: tuple[str, ...]
    joint_state: tuple[int, ...]
    q: tuple[float, ...]
    weights: tuple[float, ...]
    driver: int
    reward: float
    degraded: bool
    learned_weights: tuple[float, ...] = ()
    """Empty in recordings made before this field existed."""
