"""What a person sees while a match is played: one live line on a terminal, a line now and then elsewhere."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Mapping
from time import monotonic
from typing import TextIO

_TERMINAL_PERIOD_S = 0.1
_LOG_PERIOD_S = 10.0


class Panel:
    """Shows the progress of a match on stderr, so that stdout stays the result's."""

    def __init__(self, stream: TextIO = sys.stderr) -> None:
        self._stream = stream
        self._terminal = stream.isatty()
        self._shown_s = monotonic() if not self._terminal else float("-inf")
        self._open = False

    def show(self, status: Mapping[str, str]) -> None:
        """Shows a status, not more often than one can read."""
        now = monotonic()
        if now - self._shown_s < (_TERMINAL_PERIOD_S if self._terminal else _LOG_PERIOD_S):
            return
        self._shown_s = now
        text = status_line(status)
        if self._terminal:
            width = shutil.get_terminal_size().columns - 1
            self._stream.write("\r" + text[:width].ljust(width))
            self._open = True
        else:
            self._stream.write(text + "\n")
        self._stream.flush()

    def say(self, text: str) -> None:
        """Prints a line of its own."""
        self.close()
        print(text, file=self._stream, flush=True)

    def close(self) -> None:
        """Leaves the live line standing and goes below it."""
        if self._open:
            self._stream.write("\n")
            self._stream.flush()
            self._open = False


def status_line(status: Mapping[str, str]) -> str:
    """One line from the fields of a status (those of fbql_fusion.status)."""
    score = f"{status['goals']} goals, {status['own_goals']} own goals, {status['timeouts']} timeouts"
    weights = f" · weights {status['weights']}" if status["weights"] else ""
    return (
        f"episode {status['episode']} ({status['phase']}) · step {status['step']} · {score} · "
        f"{status['steps_per_s']} steps/s{weights}"
    )
