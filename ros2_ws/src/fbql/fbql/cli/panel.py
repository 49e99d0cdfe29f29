"""What a person sees while a match is played: one live line on a terminal, a line now and then elsewhere."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Mapping
from contextlib import suppress
from errno import EIO, EPIPE
from time import monotonic
from typing import TextIO

_TERMINAL_PERIOD_S = 0.1
_LOG_PERIOD_S = 10.0
_UNKNOWN_WIDTH = 80


class Panel:
    """Shows the progress of a match on stderr, so that stdout stays the result's.

    A terminal that is gone, or a pipe that nobody reads any more, is no reason to lose a match: nothing is shown then.
    """

    def __init__(self, stream: TextIO = sys.stderr) -> None:
        self._stream = stream
        self._terminal = stream.isatty()
        self._shown_s = monotonic() if not self._terminal else float("-inf")
        self._line = ""
        """The live line that stands open."""

    def show(self, status: Mapping[str, str]) -> None:
        """Shows a status, not more often than one can read."""
        now = monotonic()
        if now - self._shown_s < (_TERMINAL_PERIOD_S if self._terminal else _LOG_PERIOD_S):
            return
        self._shown_s = now
        if self._terminal:
            # Room for the ^C that the terminal writes behind the line.
            line = status_line(status, self._width() - 3)
            self._write("\r" + line.ljust(len(self._line)))
            self._line = line
        else:
            self._write(status_line(status) + "\n")

    def say(self, text: str) -> None:
        """Prints a line of its own."""
        self.close()
        self._write(text + "\n")

    def close(self) -> None:
        """Leaves the live line standing and goes below it."""
        if self._line:
            self._line = ""
            self._write("\n")

    def _write(self, text: str) -> None:
        try:
            self._stream.write(text)
            self._stream.flush()
        except OSError:
            _silence(self._stream)

    def _width(self) -> int:
        with suppress(OSError):
            return os.get_terminal_size(self._stream.fileno()).columns or _UNKNOWN_WIDTH
        return _UNKNOWN_WIDTH


def status_line(status: Mapping[str, str], width: int | None = None) -> str:
    """One line from the fields of a status (those of fbql_fusion.status), in the longest form that fits."""
    names, weights = status["weights"].split()[::2], status["weights"].split()[1::2]
    named = " ".join(f"{name} {weight}" for name, weight in zip(names, weights, strict=True))
    goals, own_goals, timeouts = status["goals"], status["own_goals"], status["timeouts"]
    episode, rate = f"episode {status['episode']}", f"{status['steps_per_s']} steps/s"
    score = f"{goals} goals, {own_goals} own goals, {timeouts} timeouts"
    long = f"{episode} ({status['phase']}) · step {status['step']} · {score} · {rate} · "
    short = f"{episode} · {score.replace('own goals', 'own')} · {rate} · "
    numbers = " ".join(weights)
    lines = [
        f"{long}weights {named}",
        *(short + end for end in (f"weights {named}", named, f"weights {numbers}", numbers)),
    ]
    return next((line for line in lines if width is None or len(line) <= width), lines[-1][:width])


def say(text: str) -> None:
    """Prints a line for people on stderr."""
    print(text, file=sys.stderr, flush=True)


def warn(warnings: Iterable[str]) -> None:
    """Prints each warning as a line on stderr."""
    for warning in warnings:
        say(f"warning: {warning}")


def print_result(text: str) -> None:
    """Prints on stdout. A reader that left (`| head`, a closed terminal) is no error; raises OSError for others."""
    try:
        print(text, flush=True)
    except OSError as error:
        _silence(sys.stdout)
        if error.errno not in (EPIPE, EIO):
            raise


def _silence(stream: TextIO) -> None:
    """What is still buffered must not fail once more when Python ends: that would change the exit code."""
    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, stream.fileno())
    os.close(null)
