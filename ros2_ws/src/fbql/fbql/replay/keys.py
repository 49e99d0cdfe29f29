"""Keys that are pressed while a recording is replayed: the terminal gives each at once, and is given back as it was."""

from __future__ import annotations

import os
import select
import signal
import sys
import termios
from contextlib import suppress
from time import sleep
from types import FrameType, TracebackType

from fbql.replay.pace import Order

_KEYS = {b" ": Order.PAUSE, b"s": Order.STEP, b"S": Order.STEP, b"q": Order.QUIT, b"Q": Order.QUIT}


class Keys:
    """Standard input's keys, between `with` and its end. Where that is no terminal, or not ours, nothing is pressed.

    Ctrl-Z gives the terminal back until the process goes on; Ctrl-C stays a signal.
    """

    def __init__(self) -> None:
        self._fd = 0
        self._before: list[object] | None = None
        self._stop_asked = False

    def __enter__(self) -> Keys:
        self._take()
        if self._before is not None:
            signal.signal(signal.SIGTSTP, self._note_stop)
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        if self._before is not None:
            signal.signal(signal.SIGTSTP, signal.SIG_DFL)
        self._give_back()

    @property
    def are_read(self) -> bool:
        """Whether somebody can press them."""
        return self._before is not None

    def pressed(self, patience_s: float) -> list[Order]:
        """What is asked for; waits for it, at most so long [s]."""
        if self._stop_asked:
            self._stop()
        if self._before is None:
            sleep(patience_s)
            return []
        try:
            if not select.select([self._fd], [], [], patience_s)[0]:
                return []
            data = os.read(self._fd, 64)
        except OSError:
            data = b""
        if not data:  # the terminal is gone
            self._before = None
        return [_KEYS[key] for key in (data[index : index + 1] for index in range(len(data))) if key in _KEYS]

    def _take(self) -> None:
        """Takes the terminal over, unless we are in the background: the shell has it then."""
        with suppress(OSError, ValueError, termios.error):
            self._fd = sys.stdin.fileno()
            if not os.isatty(self._fd) or os.tcgetpgrp(self._fd) != os.getpgrp():
                return
            self._before = termios.tcgetattr(self._fd)
            mode = termios.tcgetattr(self._fd)
            mode[3] &= ~(termios.ICANON | termios.ECHO)
            mode[6][termios.VMIN], mode[6][termios.VTIME] = 1, 0
            termios.tcsetattr(self._fd, termios.TCSANOW, mode)

    def _give_back(self) -> None:
        if self._before is not None:
            with suppress(termios.error):
                termios.tcsetattr(self._fd, termios.TCSANOW, self._before)
            self._before = None

    def _stop(self) -> None:
        """Lets the process be stopped, by the signal's own effect, with the terminal given back meanwhile."""
        self._stop_asked = False
        self._give_back()
        signal.signal(signal.SIGTSTP, signal.SIG_DFL)
        os.kill(os.getpid(), signal.SIGTSTP)
        self._take()
        signal.signal(signal.SIGTSTP, self._note_stop)

    def _note_stop(self, _number: int, _frame: FrameType | None) -> None:
        self._stop_asked = True
