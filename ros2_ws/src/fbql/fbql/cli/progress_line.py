"""A line on a terminal that says how far something is; nothing elsewhere, so that logs stay readable."""

from __future__ import annotations

import sys
from time import monotonic
from typing import TextIO

_PERIOD_S = 0.1


class ProgressLine:
    """Shows one line on stderr, where that is a terminal, and takes it away at the end."""

    def __init__(self, stream: TextIO | None = None) -> None:
        self._stream = stream or sys.stderr
        self._shown_s = float("-inf")
        self._width = 0
        self._is_terminal = self._stream.isatty()

    def show(self, text: str) -> None:
        """Shows a line in place of the last, not more often than one can read."""
        now = monotonic()
        if self._is_terminal and now - self._shown_s >= _PERIOD_S:
            self._shown_s = now
            self._write(text)

    def close(self) -> None:
        """Takes the line away."""
        if self._width:
            self._write("")
            self._stream.write("\r")
            self._stream.flush()
            self._width = 0

    def _write(self, text: str) -> None:
        try:
            self._stream.write(f"\r{text.ljust(self._width)}")
            self._stream.flush()
        except OSError:
            self._is_terminal = False
        self._width = len(text)
