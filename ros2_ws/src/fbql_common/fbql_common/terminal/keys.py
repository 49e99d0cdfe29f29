"""The bytes that a terminal sends for a key, and what the key means to a person who drives or watches."""

from __future__ import annotations

import re
from collections.abc import Mapping
from enum import Enum, auto


class Key(Enum):
    """What a key press requests."""

    FASTER = auto()
    SLOWER = auto()
    LEFT = auto()
    RIGHT = auto()
    STOP = auto()
    NEXT = auto()
    UNDO = auto()
    FINISH = auto()
    PAUSE = auto()
    STEP = auto()


DRIVING = frozenset({Key.FASTER, Key.SLOWER, Key.LEFT, Key.RIGHT, Key.STOP})
"""The driving keys."""
DRIVING_KEYS: Mapping[bytes, Key] = {
    b"w": Key.FASTER,
    b"s": Key.SLOWER,
    b"a": Key.LEFT,
    b"d": Key.RIGHT,
    b" ": Key.STOP,
    b"n": Key.NEXT,
    b"\r": Key.NEXT,
    b"\n": Key.NEXT,
    b"u": Key.UNDO,
    b"q": Key.FINISH,
}
"""The characters of a person who drives."""
WATCHING_KEYS: Mapping[bytes, Key] = {
    b" ": Key.PAUSE,
    b"s": Key.STEP,
    b"+": Key.FASTER,
    b"=": Key.FASTER,
    b"-": Key.SLOWER,
    b"n": Key.NEXT,
    b"u": Key.UNDO,
    b"q": Key.FINISH,
}
"""The characters of a person who watches."""
_ARROWS = {b"A": Key.FASTER, b"B": Key.SLOWER, b"C": Key.RIGHT, b"D": Key.LEFT}
"""Last byte of an arrow key's sequence (ECMA-48, as all current terminals send it)."""
_SEQUENCE = re.compile(rb"\x1b(?:\[[0-?]*[ -/]*[@-~]|O.|[^\[O\x1b])", re.DOTALL)
"""A whole escape sequence: CSI with parameters, SS3 and one byte, or Alt and one byte."""
_BEGUN = re.compile(rb"\x1b(?:\[[0-?]*[ -/]*|O)?\Z")
"""A sequence that is not complete yet."""
_LONGEST = 64


class KeyDecoder:
    """Turns the bytes of a terminal into keys, in whatever pieces they come; skips those without a meaning here.

    Args:
        characters: what each character means; arrows mean the same everywhere.
    """

    def __init__(self, characters: Mapping[bytes, Key] = DRIVING_KEYS) -> None:
        self._characters = characters
        self._rest = b""

    def feed(self, data: bytes) -> list[Key]:
        """The keys in the bytes since the last call. Call it with no bytes, too: that ends a lone Escape.

        A sequence comes in one piece or nearly so; an escape character that is alone for a whole call was the Escape key.
        """
        if not data:
            self._rest = b""
            return []
        data = self._rest + data
        self._rest = b""
        keys: list[Key] = []
        at = 0
        while at < len(data):
            if data[at : at + 1] != b"\x1b":
                self._take(self._characters.get(data[at : at + 1].lower()), keys)
                at += 1
            elif sequence := _SEQUENCE.match(data, at):
                arrow = sequence[0][1:2] in (b"[", b"O") and len(sequence[0]) > 2
                self._take(_ARROWS.get(sequence[0][-1:]) if arrow else None, keys)
                at = sequence.end()
            elif _BEGUN.match(data, at) and len(data) - at <= _LONGEST:
                self._rest = data[at:]
                break
            else:
                at += 1
        return keys

    @staticmethod
    def _take(key: Key | None, keys: list[Key]) -> None:
        if key is not None:
            keys.append(key)
