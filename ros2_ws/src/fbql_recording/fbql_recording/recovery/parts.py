"""The results of scanning a damaged file: sound parts, and the gaps between them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field

from fbql_recording.recovery.step_order import StepRange


@dataclass(eq=False)
class Gap:
    """A part of a file that is lost, or a place where parts do not follow each other."""

    begin: int
    end: int
    """Bytes begin to end - 1."""
    why: str
    opcode: int = 0
    """Of the damaged record, if it can be read."""
    chunks: int = 0
    start_ns: int | None = None
    end_ns: int | None = None
    """Smallest and largest log time in it [ns]; None: not known."""
    messages: Counter[int] = field(default_factory=Counter[int])
    """Messages in it by channel id: a lower bound."""
    attachment: str = ""
    """The name of the attachment, if it was one."""
    is_record: bool = False
    """Whether it is one record, of which only the length is reliable."""
    is_between_messages: bool = True
    """Whether messages, or the notes between them, may be missing between those before and after it."""
    is_odd: bool = False
    """Whether it is about sound data that do not belong where they are. Then nothing need be lost in it."""


@dataclass(eq=False)
class Span:
    """A sound record, or several messages outside of chunks."""

    opcode: int
    begin: int
    end: int
    has_crc: bool = True
    counts: Counter[int] = field(default_factory=Counter[int])
    """Messages by channel id."""
    first: Mapping[int, int] = field(default_factory=dict[int, int])
    last: Mapping[int, int] = field(default_factory=dict[int, int])
    """Numbers of the first and last message by channel id; of a chunk only."""
    start_ns: int = 0
    end_ns: int = 0
    """Smallest and largest log time of its messages [ns]."""
    identity: tuple[str, int, int, bytes] = ("", 0, 0, b"")
    """Of a chunk: compression, compressed size, size, and a hash of its content."""
    steps: StepRange | None = None
    """The steps of its world states; None without any."""
    name: str = ""
    """Of an attachment or Metadata record."""


Found = list[Span | Gap]
"""In the order of the file."""
