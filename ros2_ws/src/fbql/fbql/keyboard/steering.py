"""Keys to wheel velocities, for terminals, which report that a key is pressed, and repeat it, but not that it is released.

The speed is kept: each press changes it by one level. The turn ends when presses stop coming: a tap turns by a few degrees;
holding the key (the terminal repeats it) keeps turning, and faster after a while. So one hand is enough to steer, and
no turn has to be undone.

All velocities are whole levels of the paper's 29 (`fbql_behaviors.core.quantizer`), so that a pattern's class is exactly
what was driven.
"""

from __future__ import annotations

from fbql_behaviors.core.quantizer import rad_s_of
from fbql_common.terminal.keys import Key

FASTEST_LEVEL = 8
"""Highest speed [levels]: 1.0 m/s; nobody can react in time at higher speeds."""
FASTEST_BACK_LEVEL = 4
"""Highest speed backwards [levels]."""
HOLD_S = 0.13
"""How long one press of a turn key turns [s]: longer than the pause between a terminal's repeats (0.03 to 0.1)."""
REPEAT_S = 0.2
"""Presses of a turn key that are no farther apart than this count as one that is held [s]."""
STRONGER_S = 0.25
"""Holding a turn key adds one level of turn after each such interval [s]."""
STRONGEST_TURN = 3
"""Strongest turn: difference between the wheels [levels], 5.4 rad/s."""


class Steering:
    """The wheel velocities that the keys request. Times are those of any steady clock [s]."""

    def __init__(self) -> None:
        self.speed = 0
        """Speed [levels], negative backwards."""
        self._side = 0
        self._begun_s = 0.0
        self._pressed_s = float("-inf")

    def press(self, key: Key, now_s: float) -> None:
        """Takes a driving key; others change nothing."""
        if key is Key.FASTER:
            self.speed = min(self.speed + 1, FASTEST_LEVEL)
        elif key is Key.SLOWER:
            self.speed = max(self.speed - 1, -FASTEST_BACK_LEVEL)
        elif key is Key.STOP:
            self.stop()
        elif key in (Key.LEFT, Key.RIGHT):
            side = 1 if key is Key.LEFT else -1
            if side != self._side or now_s - self._pressed_s > REPEAT_S:
                self._begun_s = now_s
            self._side, self._pressed_s = side, now_s

    def stop(self) -> None:
        """Brings the wheels to rest."""
        self.speed = 0
        self._side, self._pressed_s = 0, float("-inf")

    def turn(self, now_s: float) -> int:
        """The turn at this moment [levels between the wheels], positive to the left."""
        if now_s - self._pressed_s > HOLD_S:
            return 0
        return self._side * min(1 + int((now_s - self._begun_s) / STRONGER_S), STRONGEST_TURN)

    def levels(self, now_s: float) -> tuple[int, int]:
        """The levels (left, right) at this moment. An odd turn slows the inner wheel rather than speeding up the outer."""
        turn = self.turn(now_s)
        inner, outer = self.speed - (abs(turn) + 1) // 2, self.speed + abs(turn) // 2
        return (inner, outer) if turn >= 0 else (outer, inner)

    def command(self, now_s: float) -> tuple[float, float]:
        """The wheel velocities (left, right) at this moment [rad/s]."""
        left, right = self.levels(now_s)
        return rad_s_of(left), rad_s_of(right)
