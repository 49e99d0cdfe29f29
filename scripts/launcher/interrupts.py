"""SIGINT, SIGTERM and SIGHUP to a launcher: noted, and acted on by its loop. The second one changes nothing."""

from __future__ import annotations

import signal
from types import FrameType

NUMBERS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class Interrupts:
    """Notes the first signal that asks for the end; `came` is its number, 0 before."""

    def __init__(self) -> None:
        self.came = 0
        for number in NUMBERS:
            signal.signal(number, self._note)

    def _note(self, number: int, _frame: FrameType | None) -> None:
        self.came = self.came or number
