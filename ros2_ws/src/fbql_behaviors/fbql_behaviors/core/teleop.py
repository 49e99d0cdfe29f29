"""From keys to velocity commands of a robot with a differential drive.

A terminal reports key presses, and repeats a held key, but does not report releases. So each press changes the speed or
the turn rate by a step, holding a key repeats that up to the limit, and both return to 0 when presses stop.
"""

from __future__ import annotations

from dataclasses import dataclass

from fbql_common.core.parameters import parameter
from fbql_common.core.twist import Twist


@dataclass(frozen=True)
class TeleopParameters:
    """Parameters of the keyboard teleoperation."""

    max_linear_m_s: float = parameter(0.5, "highest speed, forwards and backwards", unit="m/s", low=0.01, high=20.0)
    max_angular_rad_s: float = parameter(1.0, "highest turn rate, to either side", unit="rad/s", low=0.01, high=20.0)
    steps: int = parameter(10, "key presses from rest to the limit", low=1, high=100)
    release_s: float = parameter(
        0.7,
        "keys count as released when none was pressed for this long; longer than the pause before a terminal repeats a key "
        "that is held, which is up to .66 s",
        unit="s",
        low=0.1,
        high=5.0,
    )
    rate_hz: float = parameter(20.0, "commands per second", unit="1/s", low=1.0, high=200.0)
    publish_when_idle: bool = parameter(
        False,
        "whether zero commands are published while no key is pressed; otherwise only for half a second after a release",
    )
    stamped: bool = parameter(False, "whether geometry_msgs/TwistStamped is published instead of geometry_msgs/Twist")
    frame: str = parameter("base_link", "frame of stamped commands")


class Teleop:
    """The velocity command that the keys request. Times are those of any steady clock [s]."""

    def __init__(self, parameters: TeleopParameters) -> None:
        self._parameters = parameters
        self._speed = self._turn = 0
        """Steps, positive forwards and to the left."""
        self._driven_s = self._turned_s = float("-inf")

    def drive(self, direction: int, now_s: float) -> None:
        """Takes a press of a key for forwards (1) or backwards (-1)."""
        self._release(now_s)
        self._speed = self._limited(self._speed + direction)
        self._driven_s = now_s

    def turn(self, side: int, now_s: float) -> None:
        """Takes a press of a key for left (1) or right (-1). It also keeps the speed from dropping, because a terminal
        repeats only one held key."""
        self._release(now_s)
        self._turn = self._limited(self._turn + side) if self._turn * side > 0 else side
        self._driven_s = self._turned_s = now_s

    def stop(self) -> None:
        """Brings the robot to rest."""
        self._speed = self._turn = 0

    def command(self, now_s: float) -> Twist:
        """The command at this moment."""
        self._release(now_s)
        steps = self._parameters.steps
        return Twist(
            linear_x_m_s=self._parameters.max_linear_m_s * self._speed / steps,
            angular_z_rad_s=self._parameters.max_angular_rad_s * self._turn / steps,
        )

    def _release(self, now_s: float) -> None:
        if now_s - self._driven_s > self._parameters.release_s:
            self._speed = 0
        if now_s - self._turned_s > self._parameters.release_s:
            self._turn = 0

    def _limited(self, steps: int) -> int:
        return max(-self._parameters.steps, min(steps, self._parameters.steps))
