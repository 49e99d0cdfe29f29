"""What the set-up says while it works. All of it goes to stderr: stdout belongs to the command."""

from __future__ import annotations

import contextlib
import os
import shutil
import sys
import time


def say(text: str) -> None:
    """One line to stderr. A closed or full stderr is no reason to stop."""
    with contextlib.suppress(OSError, ValueError):
        sys.stderr.write(f"[set-up] {text}\n")
        sys.stderr.flush()


class Step:
    """A numbered piece of work: announced when it starts, its seconds shown as it goes on and when it is done."""

    def __init__(self, number: int, count: int, text: str) -> None:
        self._label = f"[set-up {number}/{count}]"
        self._text = text
        self._head = f"{self._label} {text} ..."
        self._started = time.monotonic()
        self._live = self._is_terminal()
        self._write(self._head if self._live else self._head + "\n")

    @staticmethod
    def _is_terminal() -> bool:
        return bool(sys.stderr) and sys.stderr.isatty() and os.environ.get("TERM") != "dumb"

    def tick(self, detail: str = "") -> None:
        """Show the elapsed seconds and `detail` on the same line of a terminal; elsewhere say nothing."""
        if self._live:
            line = f"{self._label} {time.monotonic() - self._started:3.0f} s  {self._text} ... {detail}"
            self._write("\r\x1b[K" + line[: shutil.get_terminal_size().columns - 1])

    def done(self) -> None:
        """Close the line with the time it took."""
        seconds = f"{time.monotonic() - self._started:.1f} s"
        self._write(f"\r\x1b[K{self._head} {seconds}\n" if self._live else f"{self._label} done in {seconds}\n")

    def failed(self) -> None:
        """Close the line so that the error starts on one of its own."""
        if self._live:
            self._write("\n")

    @staticmethod
    def _write(text: str) -> None:
        with contextlib.suppress(OSError, ValueError):
            sys.stderr.write(text)
            sys.stderr.flush()
