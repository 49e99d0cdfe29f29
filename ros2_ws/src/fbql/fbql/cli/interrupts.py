"""SIGINT, SIGTERM and SIGHUP to a command: remembered, and acted on by its loop. A second one changes nothing."""

from __future__ import annotations

import atexit
import signal
from types import FrameType

NUMBERS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


def hold_signals() -> None:
    """Makes signals wait until `Interrupts.let_in`: while modules are imported they would end in a traceback, or be lost
    where Python ignores exceptions."""
    signal.pthread_sigmask(signal.SIG_BLOCK, NUMBERS)


class Interrupted(Exception):
    """A signal ended the command before there was a result; the text says so."""


class Interrupts:
    """Remembers, once installed, the first signal that asks the command to end; `came` is its number, 0 before."""

    def __init__(self) -> None:
        self.came = 0

    def install(self) -> None:
        """Remembers signals from now on, instead of letting them end the process."""
        for number in NUMBERS:
            signal.signal(number, self._note)
        # Python ends with the default actions, so that a signal in its last moments would take the exit code away.
        atexit.register(_ignore)

    def let_in(self) -> None:
        """Lets signals act that came, or come, while the program is being loaded: whatever started it makes them wait."""
        signal.pthread_sigmask(signal.SIG_UNBLOCK, NUMBERS)

    @property
    def name(self) -> str:
        """The name of the signal that came."""
        return signal.Signals(self.came).name

    def check(self, so_far: str = "nothing was written") -> None:
        """Raises Interrupted when a signal came."""
        if self.came:
            raise Interrupted(f"ended by {self.name}; {so_far}")

    def _note(self, number: int, _frame: FrameType | None) -> None:
        self.came = self.came or number


def _ignore() -> None:
    for number in NUMBERS:
        signal.signal(number, signal.SIG_IGN)
