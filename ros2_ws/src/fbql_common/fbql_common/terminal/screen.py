"""The terminal: taken over to read every key immediately and to be drawn on, and always restored to its previous state.

It is opened again as a separate non-blocking file description: a terminal that accepts no output (because it is gone
or hangs) then cannot prevent the demonstrations from being saved.
"""

from __future__ import annotations

import codecs
import errno
import locale
import os
import select
import shutil
import signal
import termios
from collections.abc import Mapping
from contextlib import suppress
from types import FrameType, TracebackType
from typing import Self

from fbql_common.core.errors import BadInput
from fbql_common.terminal.keys import DRIVING_KEYS, Key, KeyDecoder

Span = tuple[str, str]
"""Text and its style, as the parameters of SGR (`ESC [ ... m`); no style is empty."""
Line = list[Span]

_TAKE = "\x1b[?1049h\x1b[?25l\x1b[?7l\x1b[2J"
"""Alternate screen, no cursor, no wrapping at the edge, all blank."""
_TOGETHER, _SHOWN = "\x1b[?2026h", "\x1b[?2026l"
"""Synchronized output: text between them appears at once in terminals that support it; others ignore it."""
_GIVE_BACK = "\x1b[?2026l\x1b[m\x1b[?7h\x1b[?25h\x1b[?1049l"
_WITHOUT_BRAILLE = ("linux", "vt", "ansi")
"""Beginnings of the names of terminals that have no braille patterns."""
_MOST_BYTES = 4096
_LAST_WRITE_S = 0.5
"""How long restoring waits for a slow terminal [s]."""


def text_of(line: Line, colour: bool) -> str:
    """A line as a terminal takes it, in colors or plain."""
    if not colour:
        return "".join(text for text, _ in line)
    return "".join(f"\x1b[{style}m{text}\x1b[m" if style else text for text, style in line)


def trouble_with_terminal() -> str | None:
    """Why standard input's terminal can't be drawn on; None when it can."""
    if not os.isatty(0):
        return "standard input is not one; start it in a terminal"
    name = os.environ.get("TERM", "")
    return f"TERM is '{name}'; start it in another" if name in ("", "dumb", "unknown") else None


def require_terminal() -> None:
    """Raises BadInput where standard input's terminal can't be drawn on."""
    if trouble := trouble_with_terminal():
        raise BadInput(f"an interactive terminal is needed: {trouble}")


class RawTerminal:
    """The terminal that is standard input, between `with` and its end: every key arrives immediately, and none is
    echoed.

    Ctrl-Z restores it until the process continues; Ctrl-C remains a signal. In the background it is not taken over: the
    shell has it then, until `fg`. Raises OSError when standard input is not a terminal, or one that can't be opened.
    """

    def __init__(self) -> None:
        if not os.isatty(0):
            raise OSError(errno.ENOTTY, os.strerror(errno.ENOTTY))
        self._fd = os.open(os.ttyname(0), os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK | os.O_CLOEXEC)
        self.gone = False
        """Whether the terminal was closed."""
        self.taken = False
        self.stop_asked = False
        """Whether Ctrl-Z was pressed; `stopped` then stops the process."""

    def __enter__(self) -> Self:
        self._before = termios.tcgetattr(self._fd)
        signal.signal(signal.SIGTSTP, self._note_stop)
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        self.give_back()
        signal.signal(signal.SIGTSTP, signal.SIG_DFL)
        os.close(self._fd)

    def fileno(self) -> int:
        """The file descriptor on which to wait for keys."""
        return self._fd

    def take(self) -> bool:
        """Takes the terminal over, unless the process is in the background. Returns whether it is taken over."""
        if self.taken or self.gone:
            return not self.gone
        with suppress(OSError):  # not our controlling terminal: nobody shares it with us
            if os.tcgetpgrp(self._fd) != os.getpgrp():
                return False
        try:
            self._set_mode()
        except termios.error:
            self.gone = True
            return False
        self.taken = True
        return True

    def give_back(self) -> None:
        """Leaves the terminal as it was before."""
        if self.taken:
            self.taken = False
            with suppress(termios.error):
                termios.tcsetattr(self._fd, termios.TCSANOW, self._before)

    def read(self, patience_s: float = 0.0) -> bytes:
        """The bytes of the keys pressed since the last call; waits for some at most this long [s]."""
        if not self.taken:
            return b""
        try:
            if not select.select([self._fd], [], [], patience_s)[0]:
                return b""
            data = os.read(self._fd, _MOST_BYTES)
        except BlockingIOError:
            return b""
        except OSError:
            data = b""
        self.gone = self.gone or not data
        return data

    def stopped(self) -> bool:
        """Lets the process be stopped if that was requested (Ctrl-Z), with the terminal restored meanwhile.

        True when it was stopped and now continues.
        """
        if not self.stop_asked:
            return False
        self.stop_asked = False
        self.give_back()
        # Relies on the signal's default effect, which spares a process that nobody could wake again.
        signal.signal(signal.SIGTSTP, signal.SIG_DFL)
        os.kill(os.getpid(), signal.SIGTSTP)
        signal.signal(signal.SIGTSTP, self._note_stop)
        return True

    def _set_mode(self) -> None:
        """Sets the mode: every key immediately, and nothing that would swallow one or stop the output."""
        mode = termios.tcgetattr(self._fd)
        mode[0] &= ~(termios.IXON | termios.ICRNL)
        mode[3] &= ~(termios.ICANON | termios.ECHO)
        # Ctrl-\ would end the process without a word, Ctrl-V hide the next key.
        for number in (termios.VQUIT, termios.VLNEXT):
            mode[6][number] = b"\0"
        mode[6][termios.VMIN], mode[6][termios.VTIME] = 1, 0
        termios.tcsetattr(self._fd, termios.TCSANOW, mode)

    def _note_stop(self, _number: int, _frame: FrameType | None) -> None:
        self.stop_asked = True


class Screen(RawTerminal):
    """A terminal to draw pages on. Raises BadInput when standard input is not a terminal, or one that can't be drawn
    on.

    Args:
        ascii_only: draw only ASCII even where the terminal has more.
        characters: what each character key means.
    """

    def __init__(self, ascii_only: bool = False, characters: Mapping[bytes, Key] = DRIVING_KEYS) -> None:
        require_terminal()
        try:
            super().__init__()
        except OSError as error:
            raise BadInput(f"the terminal cannot be opened ({error.strerror}); start it in another") from None
        name = os.environ["TERM"]
        unicode = codecs.lookup(locale.nl_langinfo(locale.CODESET) or "ascii").name == "utf-8"
        self.ascii_only = ascii_only or not unicode or name.startswith(_WITHOUT_BRAILLE)
        """Whether to draw only ASCII."""
        self._colour = not os.environ.get("NO_COLOR")
        self._decoder = KeyDecoder(characters)
        self._waiting = b""
        self._shown: list[str] = []
        self._size = (0, 0)

    @property
    def size(self) -> tuple[int, int]:
        """Columns and rows."""
        with suppress(OSError):
            size = os.get_terminal_size(self._fd)
            if size.columns and size.lines:
                return size.columns, size.lines
        return shutil.get_terminal_size()

    def pressed(self) -> list[Key]:
        """The keys that were pressed since the last call."""
        return self._decoder.feed(self.read()) if self.taken else []

    def show(self, lines: list[Line]) -> None:
        """Shows a page: the lines that differ from those shown. A terminal still busy with the last page misses it."""
        if not self.take():
            return
        if self._size != self.size:
            self._size, self._shown = self.size, []
            self._waiting += b"\x1b[2J"
        texts = [text_of(line, self._colour) for line in lines]
        self._flush()
        if self._waiting:
            return
        rows = max(len(texts), len(self._shown))
        old, new = (page + [""] * (rows - len(page)) for page in (self._shown, texts))
        changed = [row for row in range(rows) if old[row] != new[row]]
        # Erased before, not after: beyond the last column there is nothing to erase from.
        drawn = "".join(f"\x1b[{row + 1}H\x1b[K{new[row]}" for row in changed)
        self._waiting = f"{_TOGETHER}{drawn}{_SHOWN}".encode(errors="replace") if drawn else b""
        self._shown = texts
        self._flush()

    def take(self) -> bool:
        """Takes the terminal over and blanks it. Returns whether it is taken over."""
        if not self.taken and super().take():
            self._shown = []
            self._waiting = _TAKE.encode()
            self._flush()
        return self.taken

    def give_back(self) -> None:
        """Restores the terminal. Pending output is dropped; a slow terminal is given a moment."""
        if self.taken:
            self._waiting = _GIVE_BACK.encode()
            self._flush(_LAST_WRITE_S)
        super().give_back()

    def _flush(self, patience_s: float = 0.0) -> None:
        try:
            while self._waiting:
                if not select.select([], [self._fd], [], patience_s)[1]:
                    return
                self._waiting = self._waiting[os.write(self._fd, self._waiting) :]
        except BlockingIOError:
            return
        except OSError:
            self.gone = True
            self._waiting = b""
