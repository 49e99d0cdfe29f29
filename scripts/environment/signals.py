"""Signals that end a program, which wait while one is being loaded.

While modules are imported, they would end in a traceback, or be lost in a place where Python ignores exceptions. What is
held stays held in a program that takes this one's place.
"""

from __future__ import annotations

import contextlib
import signal
from collections.abc import Generator

ENDING_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


def hold_signals() -> None:
    """Makes the signals wait from now on."""
    signal.pthread_sigmask(signal.SIG_BLOCK, ENDING_SIGNALS)


def let_signals_in() -> None:
    """Lets the signals act from now on; so do those that waited."""
    signal.pthread_sigmask(signal.SIG_UNBLOCK, ENDING_SIGNALS)


@contextlib.contextmanager
def signals_let_in() -> Generator[None, None, None]:
    """A context in which the signals act."""
    before = signal.pthread_sigmask(signal.SIG_UNBLOCK, ENDING_SIGNALS)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
