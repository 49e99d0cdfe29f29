"""Lines of styled text, as a terminal shows them."""

from __future__ import annotations

Span = tuple[str, str]
"""Text and its style, as the parameters of SGR (`ESC [ ... m`); no style is empty."""
Line = list[Span]


def text_of(line: Line, colour: bool) -> str:
    """A line as a terminal takes it, in colours or plain."""
    if not colour:
        return "".join(text for text, _ in line)
    return "".join(f"\x1b[{style}m{text}\x1b[m" if style else text for text, style in line)
