"""What the set-up says while it works. All of it goes to stderr: stdout belongs to the command."""

from __future__ import annotations

import contextlib
import os
import shutil
import sys
import time


def write(text: str) -> None:
    """Write to stderr. One that is closed, full or was never there is no reason to stop."""
    with contextlib.suppress(OSError, ValueError, AttributeError):
        sys.stderr.write(text)
        sys.stderr.flush()


def say(text: str) -> None:
    """One line of the set-up's."""
    write(f"[set-up] {text}\n")


def is_terminal() -> bool:
    """Whether stderr is a terminal that can rewrite a line."""
    try:
        return sys.stderr.isatty() and os.environ.get("TERM") != "dumb"
    except (ValueError, AttributeError):
        return False


class Step:
    """A numbered piece of work: announced when it starts, its seconds shown as it goes on and when it is done."""

    def __init__(self, number: int, count: int, text: str) -> None:
        self._label = f"[set-up {number}/{count}]"
        self._text = text
        self._head = f"{self._label} {text} ..."
        self._started = time.monotonic()
        self._live = is_terminal()
        write(self._head if self._live else self._head + "\n")

    def tick(self, detail: str = "") -> None:
        """Show the elapsed seconds and `detail` on the same line of a terminal; elsewhere say nothing."""
        if self._live:
            line = f"{self._label} {time.monotonic() - self._started:3.0f} s  {self._text} ... {detail}"
            write("\r\x1b[K" + line[: shutil.get_terminal_size().columns - 1])

    def done(self) -> None:
        """Close the line with the time it took."""
        seconds = f"{time.monotonic() - self._started:.1f} s"
        write(f"\r\x1b[K{self._head} {seconds}\n" if self._live else f"{self._label} done in {seconds}\n")

    def failed(self) -> None:
        """Close the line so that the error starts on one of its own."""
        if self._live:
            write("\n")
