"""The interface of whatever shows a match: a terminal or a page."""

from __future__ import annotations

from contextlib import AbstractContextManager
from typing import Protocol

from fbql_common.terminal.keys import Key

from fbql.watch.moments import Moments
from fbql.watch.pace import Pace

END_S = 1.0
"""How long the end of an episode is shown [s]."""


class View(AbstractContextManager["View"], Protocol):
    """A match on a screen, between `with` and its end."""

    moments: Moments
    pace: Pace | None
    """The pace that is shown; None: the match's own."""
    message: str
    """A further note, shown where there is room."""

    @property
    def gone(self) -> bool:
        """Whether nobody can see it any more."""
        ...

    @property
    def ready(self) -> bool:
        """Whether the match need not wait for somebody to see it."""
        ...

    def hear(self, topic: str, data: bytes) -> None:
        """Takes a message of the match."""

    def keys(self, patience_s: float = 0.0) -> list[Key]:
        """The requests since the last call; waits at most this long [s] for one."""
        ...

    def draw(self) -> None:
        """Shows the latest moment, unless it did just now."""
