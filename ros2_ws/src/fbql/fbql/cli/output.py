"""What a command prints: its result on stdout, everything else on stderr, progress as one live line.

Nothing from a file, an argument or a name reaches a terminal raw: a line is printed with everything escaped that is not
printable, and characters that the stream's encoding lacks.
"""

from __future__ import annotations

import errno
import json
import os
import sys
from collections.abc import Callable, Generator, Iterable, Mapping
from contextlib import contextmanager, suppress
from math import isfinite
from pathlib import Path
from time import monotonic
from typing import Any, TextIO

from fbql_common.core.text import as_lines, encodable, one_line
from fbql_common.files import DISK_FAILURES, remedy

from fbql.cli.exit_codes import BAD_INPUT, FAILED

_PERIOD_S = 0.1
_UNKNOWN_WIDTH = 80

_program = "fbql"
_results: TextIO | None = None
"""Where results are printed inside of `results_apart`."""


def set_program(name: str) -> None:
    """Sets the name that the command in this process puts in front of every error."""
    global _program
    _program = name


def say(text: str) -> None:
    """Prints a line for people on stderr. A terminal that was closed is no error."""
    write(sys.stderr, f"{one_line(text)}\n")


def complain(text: object, output: str = "") -> None:
    """Prints what is wrong on stderr: "PROGRAM: what". Then, if given, the output of the process that it is about."""
    for line in (f"{_program}: {text}", *output.splitlines()):
        say(line)


def warn(warnings: Iterable[str]) -> None:
    """Prints each warning as a line on stderr."""
    for warning in warnings:
        complain(f"warning: {warning}")


def print_result(text: str) -> None:
    """Prints on stdout, in one line or several of our own: text from elsewhere, which might hold a newline, must go
    through `one_line` or `as_lines` first.

    A reader that is gone (`| head`, a closed terminal) is not an error.

    Raises:
        Unwritable: the disk that stdout goes to is full.
    """
    stream = _results or sys.stdout
    try:
        print(encodable(as_lines(text.split("\n")), stream.encoding), file=stream, flush=True)
    except OSError as error:
        _silence(stream)
        if error.errno not in (errno.EPIPE, errno.EIO):
            raise Unwritable("the result on stdout", error) from None


def json_text(values: Any) -> str:
    """A result as JSON, which has no NaN and no infinity: null stands for them."""
    return json.dumps(_as_json(values), allow_nan=False)


def _as_json(value: Any) -> Any:
    if isinstance(value, float):
        return value if isfinite(value) else None
    if isinstance(value, Mapping):
        return {name: _as_json(each) for name, each in value.items()}  # pyright: ignore[reportUnknownVariableType]
    return [_as_json(each) for each in value] if isinstance(value, list | tuple) else value  # pyright: ignore[reportUnknownVariableType]


@contextmanager
def results_apart() -> Generator[None]:
    """A context in which `print_result` alone writes to stdout; all else that is printed there goes to stderr.

    The libraries beneath ROS print their errors on descriptor 1, and somebody's own controller may print as well. Neither
    must get into a result that a program reads.
    """
    global _results
    if sys.stdout is None or sys.stdout is not sys.__stdout__ or sys.stdout.fileno() != 1 or _results is not None:
        yield  # a caller in this process has put something else in the place of stdout
        return
    sys.stdout.flush()
    kept = os.dup(1)
    os.dup2(2, 1)
    _results = os.fdopen(kept, "w", encoding=sys.stdout.encoding, errors=sys.stdout.errors, closefd=False)
    try:
        yield
    finally:
        with suppress(OSError):
            sys.stdout.flush()
        with suppress(OSError):
            _results.close()
        _results = None
        os.dup2(kept, 1)
        os.close(kept)


@contextmanager
def output_aside(file: Path) -> Generator[None]:
    """Redirects stderr, and what libraries print on stdout, both of which would be printed into a picture on the terminal,
    to a file; prints it afterwards."""
    sys.stderr.flush()
    kept = [os.dup(descriptor) for descriptor in (1, 2)]
    with file.open("wb") as stream:
        for descriptor in (1, 2):
            os.dup2(stream.fileno(), descriptor)
    try:
        yield
    finally:
        sys.stderr.flush()
        for descriptor, before in zip((1, 2), kept, strict=True):
            os.dup2(before, descriptor)
            os.close(before)
        for line in file.read_text(errors="replace").splitlines():
            say(line)


class LiveLine:
    """One line on a terminal that shows the progress of something; elsewhere nothing, or a line now and then.

    A terminal that is gone, or a pipe that nobody reads any more, ends the display and nothing else.

    Args:
        stream: stderr unless given.
        log_every_s: how often a line is printed where the stream is not a terminal [s]; None: never.
        keep: whether the last state stays on the terminal; otherwise the line is erased at the end.
    """

    def __init__(self, stream: TextIO | None = None, *, log_every_s: float | None = None, keep: bool = False) -> None:
        self._stream = stream or sys.stderr
        self._is_terminal = self._stream.isatty()
        self._period_s = _PERIOD_S if self._is_terminal else log_every_s
        self._keep = keep
        self._shown_s = float("-inf") if self._is_terminal else monotonic()
        self._line = ""
        """The text on the terminal that no newline has ended yet."""

    def show(self, text: str | Callable[[int | None], str]) -> None:
        """Shows a state in place of the last one, at most ten times a second.

        Args:
            text: the state, or a function that returns it for a number of columns; None: any number.
        """
        now = monotonic()
        if self._period_s is None or now - self._shown_s < self._period_s:
            return
        self._shown_s = now
        if not self._is_terminal:
            write(self._stream, f"{one_line(text if isinstance(text, str) else text(None))}\n")
            return
        width = self._width() - 3  # room for the ^C that the terminal writes behind the line
        line = one_line(text)[:width] if isinstance(text, str) else one_line(text(width))
        write(self._stream, f"\r{line.ljust(len(self._line))}")
        self._line = line

    def say(self, text: str) -> None:
        """Prints a separate line."""
        self.close()
        say(text)

    def complain(self, text: object, output: str = "") -> None:
        """Prints what is wrong in a separate line, and the output of the process that it is about."""
        self.close()
        complain(text, output)

    def close(self) -> None:
        """Erases the live line, or keeps it and moves to the next line."""
        if self._line:
            write(self._stream, "\n" if self._keep else f"\r{' ' * len(self._line)}\r")
            self._line = ""

    def _width(self) -> int:
        with suppress(OSError):
            return os.get_terminal_size(self._stream.fileno()).columns or _UNKNOWN_WIDTH
        return _UNKNOWN_WIDTH


class Unwritable(Exception):
    """An output file that can't be written. The text names the path that the user gave."""

    def __init__(self, path: Path | str, error: OSError) -> None:
        # Making the directory README.md/ ends with "File exists", which does not say what is wrong.
        reason = "Not a directory" if isinstance(error, FileExistsError) else error.strerror or str(error)
        super().__init__(f"{path}: cannot be written ({reason}); {remedy(error)}")
        self.exit_code = FAILED if error.errno in DISK_FAILURES else BAD_INPUT


@contextmanager
def writing(path: Path | str) -> Generator[None]:
    """A context in which an output is written: an OSError inside becomes Unwritable."""
    try:
        yield
    except OSError as error:
        raise Unwritable(path, error) from None


def write(stream: TextIO, text: str) -> None:
    """Writes text that is escaped. A terminal that was closed is no error."""
    try:
        stream.write(encodable(text, stream.encoding))
        stream.flush()
    except OSError:
        _silence(stream)


def _silence(stream: TextIO) -> None:
    """Buffered output must not fail once more when Python exits: that would change the exit code."""
    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, stream.fileno())
    os.close(null)
