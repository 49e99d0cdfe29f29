"""The set-up's output while it works. All of it goes to stderr: stdout belongs to the command."""

from __future__ import annotations

import os
import sys
import time


class SetUpError(Exception):
    """The environment cannot be created. The text is one line: what is wrong, and how to fix it.

    `details` is shown before it: the end of a compiler's or installer's output, if the problem is in there.
    """

    def __init__(self, line: str, details: str = "") -> None:
        super().__init__(line)
        self.details = details


def shown(text: object) -> str:
    """One line that a terminal shows as it is: what is not printable is escaped, as it may come from a name."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in str(text))


def write(text: str) -> None:
    """Write to stderr. A closed, full or missing stderr is no reason to stop."""
    try:
        sys.stderr.write(text)
        sys.stderr.flush()
    except (OSError, ValueError, AttributeError):
        pass


def say(text: str) -> None:
    """Print one line of the set-up."""
    write(f"[set-up] {shown(text)}\n")


def _fitting(line: str) -> str:
    """What fits in a line of the terminal: of one that wraps, only the last part can be overwritten."""
    from shutil import get_terminal_size

    return line[: get_terminal_size().columns - 1]


class Step:
    """A numbered piece of work: announced when it starts, its seconds shown while it runs and when it is done."""

    def __init__(self, number: int, count: int, text: str) -> None:
        self._label = f"[set-up {number}/{count}]"
        self._text = text
        self._started = time.monotonic()
        try:
            self._live = sys.stderr.isatty() and os.environ.get("TERM") != "dumb"
        except (ValueError, AttributeError):
            self._live = False
        line = f"{self._label} {text} ..."
        write(_fitting(line) if self._live else f"{line}\n")

    def tick(self, detail: str = "") -> None:
        """Show the elapsed seconds and `detail` on the same line of a terminal; elsewhere say nothing."""
        if self._live:
            line = f"{self._label} {time.monotonic() - self._started:3.0f} s  {self._text} ... {detail}"
            write("\r\x1b[K" + _fitting(line))

    def done(self) -> None:
        """Close the line with the time it took."""
        seconds = f"{time.monotonic() - self._started:.1f} s"
        head = f"\r\x1b[K{self._label} {self._text} ..." if self._live else f"{self._label} done in"
        write(f"{head} {seconds}\n")

    def failed(self) -> None:
        """Close the line so that the error starts on a new one."""
        if self._live:
            write("\n")
