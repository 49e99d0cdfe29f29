"""The FIRA middle-league field, in the frame "field" (docs/deviations.md gives the sources of the numbers)."""

from __future__ import annotations

from dataclasses import dataclass

from fbql_common.core.command_space import Axis, CommandSpace


@dataclass(frozen=True)
class Field:
    """Dimensions of the field [m]. The robot attacks the goal at +x and defends the blue goal at -x."""

    length_m: float = 2.20
    width_m: float = 1.80
    goal_width_m: float = 0.40
    goal_depth_m: float = 0.10
    corner_m: float = 0.07
    """Legs of the isosceles triangles that fill the corners."""

    @property
    def half_length_m(self) -> float:
        return self.length_m / 2

    @property
    def half_width_m(self) -> float:
        return self.width_m / 2

    @property
    def half_goal_m(self) -> float:
        return self.goal_width_m / 2


FIELD = Field()

FREE_BALL_SPOTS_M = ((0.55, 0.60), (0.55, -0.60), (-0.55, 0.60), (-0.55, -0.60))
"""The four free-ball positions (x, y) [m]."""

BALL_RADIUS_M = 0.02135
ROBOT_SIDE_M = 0.075
WHEEL_RADIUS_M = 0.02
AXLE_M = 0.07
"""Distance between the wheels [m]."""
MAX_WHEEL_RAD_S = 88.0
"""Full wheel velocity [rad/s]: 1.76 m/s, the 99.9th percentile (4.42 cm per cycle at 40 Hz) of the match logs."""
WHEELS = CommandSpace(
    (
        Axis("left", "rad/s", -MAX_WHEEL_RAD_S, MAX_WHEEL_RAD_S, 29),
        Axis("right", "rad/s", -MAX_WHEEL_RAD_S, MAX_WHEEL_RAD_S, 29),
    )
)
"""A soccer robot's command: the paper's 29 levels of each wheel (section II.A.2)."""
