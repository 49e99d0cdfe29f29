"""When the next message or step is due: at a rate, as fast as possible, paused, or step by step. Without ROS and without
a clock."""

from __future__ import annotations

from collections.abc import Callable

from fbql_common.terminal.keys import Key

POLL_S = 0.02
"""Time between two checks of the keys while there is nothing to wait for [s]."""
SLOWEST, FASTEST = 1 / 16, 64.0
"""Where slower and faster end; beyond the fastest rate comes as fast as possible."""
RATES = (*(2.0**power for power in range(-4, 7)), 0.0)
"""What slower and faster lead through, beginning with real time; 0: as fast as possible."""
_WAIT_S = 0.1
_LATE_S = 0.1
"""A delay of more than this is not made up for, where nothing should rush [s]."""
_NS = 1_000_000_000


def _no_keys(_patience_s: float) -> list[Key]:
    return []


class Pace:
    """Decides when messages are due, each of which has a time that does not depend on the clock.

    Args:
        rate: times real time; 0: as fast as possible.
        now: a steady clock [s].
        keys: waits at most this long [s] for keys, and returns them as soon as there are any.
        show: called now and then while it waits.
        catches_up: whether lost time is made up for, at the price of a burst of late messages.
    """

    def __init__(
        self,
        rate: float,
        now: Callable[[], float],
        keys: Callable[[float], list[Key]] = _no_keys,
        show: Callable[[], None] = lambda: None,
        catches_up: bool = True,
    ) -> None:
        self.rate = rate
        self.is_paused = False
        self.hurries = False
        """Whether it goes as fast as possible to the next episode."""
        self.quit = False
        """Whether the person has quit."""
        self.went_back = 0
        """How often the recording's time went back; there is no wait then."""
        self._now = now
        self._keys = keys
        self._show = show
        self._catches_up = catches_up
        self._begin_s = 0.0
        self._begin_ns = 0
        self._last_ns: int | None = None
        """Time of the last message that came out."""
        self._next_ns: int | None = None
        """Time of the message that is waiting, or was the last to wait."""
        self._steps = 0
        """Requested steps that are still to come."""
        self._looked_s = float("-inf")

    @property
    def words(self) -> str:
        """How fast it goes."""
        if self.hurries:
            return "on to the next"
        speed = "as fast as possible" if self.rate == 0.0 else f"{self.rate:g} x real time"
        return f"paused ({speed})" if self.is_paused else speed

    def restart(self) -> None:
        """The next message is due at once, whatever its time."""
        self._last_ns = self._next_ns = None

    def arrive(self) -> None:
        """An episode begins, which ends a rush to the next episode."""
        if self.hurries and self._next_ns is not None:
            self._due_now(self._next_ns)
        self.hurries = False

    def linger(self, duration_s: float) -> None:
        """Everything is due this much later [s]; less at rates above real time."""
        self._begin_s += duration_s / max(self.rate, 1.0)

    def take(self, key: Key) -> None:
        """Does what a person asks for; keys without a meaning here change nothing."""
        if key is Key.FINISH:
            self.quit = True
        elif key is Key.STEP:
            self.is_paused, self.hurries = True, False
            self._steps += 1
        elif key is Key.PAUSE:
            self.is_paused, self.hurries = self.hurries or not self.is_paused, False
            self._steps = 0
            if self._next_ns is not None:
                self._due_now(self._next_ns)
        elif key is Key.NEXT:
            self.hurries = True
        elif key in (Key.FASTER, Key.SLOWER):
            self._change_rate(key is Key.FASTER)

    def ask(self, time_ns: int) -> bool:
        """Whether a message of this time is due [ns]; then it counts as out."""
        self._await(time_ns)
        if not self._is_due(time_ns):
            return False
        if not self._catches_up and self.left_s(time_ns) < -_LATE_S:
            self._due_now(time_ns)
        self._last_ns = time_ns
        return True

    def wait(self, time_ns: int) -> bool:
        """Waits until a message of this time is due [ns]. False: do not publish it, the person has quit."""
        self._await(time_ns)
        if self._now() - self._looked_s >= POLL_S:
            self._look(0.0)
        while not self.quit and not self.ask(time_ns):
            # Time passes between two looks at the clock: a message may have become due.
            self._look(_WAIT_S if self.is_paused else min(max(self.left_s(time_ns), 0.0), _WAIT_S))
        return not self.quit

    def idle(self) -> None:
        """Looks for keys for a moment, while there is nothing to wait for."""
        self._look(_WAIT_S)

    def _await(self, time_ns: int) -> None:
        if time_ns == self._next_ns:
            return
        self._next_ns = time_ns
        if self._last_ns is None or time_ns < self._last_ns:
            self.went_back += self._last_ns is not None
            self._due_now(time_ns)

    def _is_due(self, time_ns: int) -> bool:
        # A step is whole: all that has its time belongs to it.
        if self.hurries or time_ns == self._last_ns:
            return True
        if not self.is_paused:
            return self.rate == 0.0 or self.left_s(time_ns) <= 0.0
        if self._steps:
            self._steps -= 1
            return True
        return False

    def left_s(self, time_ns: int) -> float:
        """How long until a message of this time is due, unless something holds it back [s]; negative when it is late."""
        if self.rate == 0.0:
            return 0.0
        return self._begin_s + (time_ns - self._begin_ns) / _NS / self.rate - self._now()

    def _due_now(self, time_ns: int) -> None:
        self._begin_s, self._begin_ns = self._now(), time_ns

    def _change_rate(self, faster: bool) -> None:
        before = self.rate
        if before == 0.0:
            self.rate = 0.0 if faster else FASTEST
        elif faster:
            self.rate = before * 2.0 if before < FASTEST else 0.0
        else:
            self.rate = max(before / 2.0, min(before, SLOWEST))
        if self._next_ns is None:
            return
        if before == 0.0:
            self._due_now(self._next_ns)
        elif self.rate:
            # From here on what is left takes its share longer or shorter.
            now = self._now()
            self._begin_ns += round((now - self._begin_s) * before * _NS)
            self._begin_s = now

    def _look(self, patience_s: float) -> None:
        for key in self._keys(patience_s):
            self.take(key)
        self._show()
        self._looked_s = self._now()
