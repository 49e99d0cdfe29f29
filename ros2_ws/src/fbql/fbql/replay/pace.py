"""When a recorded message is due: at a rate, as fast as possible, paused, or step by step. Without ROS and without a clock."""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum

POLL_S = 0.02
"""Time between two checks of the keys while there is nothing to wait for [s]."""
_WAIT_S = 0.1
_NS = 1_000_000_000


class Order(Enum):
    """A person's request while a recording is replayed."""

    PAUSE = "space"
    """Pause, or continue."""
    STEP = "s"
    """Publish everything with the next time stamp, then pause."""
    QUIT = "q"


class Pace:
    """Waits until messages are due.

    Args:
        rate: times real time; 0: as fast as possible.
        now: a steady clock [s].
        orders: waits at most this long [s] for orders, and returns them as soon as there are any.
        show: called now and then while it waits.
    """

    def __init__(
        self,
        rate: float,
        now: Callable[[], float],
        orders: Callable[[float], list[Order]],
        show: Callable[[], None] = lambda: None,
    ) -> None:
        self.is_paused = False
        self.quit = False
        """Whether the person has quit."""
        self.went_back = 0
        """How often the recording's time went back; there is no wait then."""
        self._rate = rate
        self._now = now
        self._orders = orders
        self._show = show
        self._begin_s = 0.0
        self._begin_ns = 0
        self._last_ns: int | None = None
        """Time of the last published message."""
        self._steps = 0
        """Requested steps that are still to come."""
        self._looked_s = float("-inf")

    def restart(self) -> None:
        """The recording starts over: its next message is due at once."""
        self._last_ns = None

    def wait(self, time_ns: int) -> bool:
        """Waits until a message of this time is due [ns]. False: do not publish it, the person has quit."""
        last_ns = self._last_ns
        if last_ns is None or time_ns < last_ns:
            self.went_back += last_ns is not None
            self._due_now(time_ns)
        if self._now() - self._looked_s >= POLL_S:
            self._look(0.0)
        while not self.quit and not self._is_due(time_ns):
            was_paused = self.is_paused
            # Time passes between two looks at the clock: a message may have become due.
            self._look(_WAIT_S if was_paused else min(max(self._left_s(time_ns), 0.0), _WAIT_S))
            if was_paused and not self.is_paused:
                self._due_now(time_ns)
        if not self.quit:
            self._last_ns = time_ns
        return not self.quit

    def _is_due(self, time_ns: int) -> bool:
        if not self.is_paused:
            return self._rate == 0.0 or self._left_s(time_ns) <= 0.0
        # A step is whole: all that has its time belongs to it.
        if time_ns == self._last_ns:
            return True
        if self._steps:
            self._steps -= 1
            return True
        return False

    def _left_s(self, time_ns: int) -> float:
        return self._begin_s + (time_ns - self._begin_ns) / _NS / self._rate - self._now()

    def _due_now(self, time_ns: int) -> None:
        self._begin_s, self._begin_ns = self._now(), time_ns

    def _look(self, patience_s: float) -> None:
        for order in self._orders(patience_s):
            if order is Order.QUIT:
                self.quit = True
            elif order is Order.STEP:
                self.is_paused = True
                self._steps += 1
            else:
                self.is_paused = not self.is_paused
                self._steps = 0
        self._show()
        self._looked_s = self._now()
