"""Text from elsewhere on its way to a terminal, a log or an error: shown, never acted on."""

from __future__ import annotations

from collections.abc import Iterable


def one_line(text: object) -> str:
    """The text as one line that a terminal shows as it is.

    Whatever is not printable is escaped as in a Python string: control characters and newlines, which would forge
    lines or colors; marks that turn the direction of writing; half of a surrogate pair, which can't be encoded.
    """
    line = str(text)
    if line.isprintable():
        return line
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in line)


def quoted(value: object) -> str:
    """The repr of a value; its type alone if it holds an integer of more than 4300 digits, which Python refuses to
    print."""
    try:
        return repr(value)
    except ValueError:
        return f"a {type(value).__name__} with too many digits"


def as_lines(lines: Iterable[object]) -> str:
    """The texts as lines, each as `one_line`."""
    return "\n".join(map(one_line, lines))


def encodable(text: str, encoding: str | None) -> str:
    """The text with what an encoding lacks escaped."""
    encoding = encoding or "utf-8"
    return text.encode(encoding, "backslashreplace").decode(encoding)
