"""SIGINT, SIGTERM and SIGHUP to a launcher: noted, and acted on by its loop. The second one changes nothing."""

from __future__ import annotations

import signal
from types import FrameType

NUMBERS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class Interrupted(Exception):
    """A signal asked for the end before anything was begun."""


class Interrupts:
    """Notes the first signal that asks for the end; `came` is its number, 0 before."""

    def __init__(self) -> None:
        self.came = 0
        for number in NUMBERS:
            signal.signal(number, self._note)

    @property
    def name(self) -> str:
        """The name of the signal that came."""
        return signal.Signals(self.came).name

    def check(self) -> None:
        """Raises Interrupted when a signal came."""
        if self.came:
            raise Interrupted(f"ended by {self.name} before the match began")

    def _note(self, number: int, _frame: FrameType | None) -> None:
        self.came = self.came or number
