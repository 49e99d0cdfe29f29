"""What is lost of a damaged MCAP file, and what tells how many messages that were.

Two things tell it: the index that follows a chunk outlives it as a rule; and our own recorder numbers the messages of each
channel from 1 on without a gap, so that the numbers around a loss tell what was in it.
"""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field

from fbql_recording.recovery.records import Tally


@dataclass
class Loss:
    """A part of a file that is lost."""

    begin: int
    end: int
    """Bytes begin to end - 1."""
    why: str
    chunks: int = 0
    start_ns: int | None = None
    end_ns: int | None = None
    """Log times that were in it, at most; None: not known."""
    messages: dict[int, int] = field(default_factory=dict[int, int])
    """Messages that were in it by channel: at least so many."""
    attachment: str = ""
    """The name of the attachment that it was."""
    is_gap: bool = True
    """Whether messages may be missing between those before and after it."""
    is_suspected: bool = False
    """Whether nothing is damaged there, but something tells that something is missing."""


class Losses:
    """What is lost of one file, gathered from front to back."""

    def __init__(self) -> None:
        self.found: list[Loss] = []
        self.counts: Counter[int] = Counter()
        """Sound messages by channel."""
        self.is_numbered = False
        """Whether the messages of each channel are numbered from 1 on without a gap."""
        self._last: dict[int, tuple[int, int]] = {}
        """Channel -> the number of its last message, and how many losses there were before it."""
        self._by_number: list[tuple[int, int, int]] = []
        """Index of the loss, channel, messages."""
        self._by_index: Counter[tuple[int, int]] = Counter()
        """The same, from the indexes of chunks."""
        self._indexes_to_come: dict[int, int] = {}
        """Of the last sound chunk: channel -> messages."""

    def count(self, tallies: Mapping[int, Tally], at: int) -> Loss | None:
        """Counts the messages of a chunk at a byte; gives a loss before it that nothing else tells of."""
        self._indexes_to_come = {channel: tally.count for channel, tally in tallies.items()}
        suspected: Loss | None = None
        for channel, tally in tallies.items():
            self.counts[channel] += tally.count
            last, losses = self._last.get(channel, (0, 0))
            missing = tally.first - last - 1
            if missing > 0 and self.is_numbered:
                since = [index for index in range(losses, len(self.found)) if not self.found[index].attachment]
                if not since:
                    suspected = Loss(at, at, f"messages before byte {at} are not there", is_suspected=True)
                    since = [len(self.found)]
                    self.found.append(suspected)
                self._by_number.append((since[-1], channel, missing))
            self._last[channel] = tally.last, len(self.found)
        return suspected

    def take_index(self, body: bytes, at: int, follows_loss: bool) -> Loss | None:
        """Takes a message index; gives the loss of its chunk where nothing else tells of that.

        Args:
            body: of its record.
            at: its byte.
            follows_loss: whether what came before it is the last loss.
        """
        channel, size = struct.unpack_from("<HI", body)
        times = struct.unpack_from(f"<{size // 8}Q", body, 6)[::2]
        if self._indexes_to_come.pop(channel, None) == len(times) or not times:
            return None
        suspected: Loss | None = None
        if not follows_loss:
            suspected = Loss(at, at, f"the chunk before the message index at byte {at} is not there", is_suspected=True)
            self.found.append(suspected)
        loss = self.found[-1]
        loss.start_ns = min(times) if loss.start_ns is None else min(loss.start_ns, *times)
        loss.end_ns = max(times) if loss.end_ns is None else max(loss.end_ns, *times)
        loss.chunks = max(loss.chunks, 1)
        self._by_index[len(self.found) - 1, channel] += len(times)
        return suspected

    def forget_indexes(self) -> None:
        """The indexes of the last sound chunk are over."""
        self._indexes_to_come = {}

    def conclude(self, data_is_sound: bool) -> None:
        """Puts together how many messages each loss took.

        Args:
            data_is_sound: the CRC of the data section matches: nothing is missing without a trace.
        """
        for (index, channel), count in self._by_index.items():
            self.found[index].messages[channel] = count
        for index, channel, count in self._by_number:
            loss = self.found[index]
            loss.messages[channel] = count
            loss.chunks = max(loss.chunks, 1)
        told = {index for index, _, _ in self._by_number}
        for index, loss in enumerate(self.found):
            if loss.start_ns is not None and loss.end_ns is not None and loss.start_ns > loss.end_ns:
                # The head of a chunk has no CRC: times that can't be are not told.
                loss.start_ns = loss.end_ns = None
            if loss.is_suspected and (data_is_sound or (self.is_numbered and index not in told)):
                # A damaged index, say: nothing is missing.
                loss.messages, loss.chunks, loss.is_gap = {}, 0, False
            elif not loss.attachment:
                loss.is_gap = bool(loss.chunks or loss.messages) or not self.is_numbered
            else:
                loss.is_gap = False
