"""A match on the terminal, live or replayed: draws its latest moment, and takes the keys."""

from __future__ import annotations

import select
from collections.abc import Iterable
from time import monotonic
from types import TracebackType
from typing import Self

from fbql_behaviors.core.tree import Tree
from fbql_common.terminal.keys import WATCHING_KEYS, Key
from fbql_common.terminal.screen import Screen

from fbql.watch.match import match_page
from fbql.watch.moments import Moments
from fbql.watch.pace import Pace
from fbql.watch.page import PICTURE_S


class MatchScreen:
    """The terminal between `with` and its end, and the match on it. Making it raises BadInput for a terminal that can't be
    drawn on.

    Args:
        trees: those that behaviors may answer with.
        message: the last line, behind how the last episode ended.
    """

    def __init__(self, trees: Iterable[Tree], message: str = "") -> None:
        self._screen = Screen(characters=WATCHING_KEYS)
        self.moments = Moments(trees)
        self.pace: Pace | None = None
        """The pace that the screen shows; None: the match's own."""
        self.message = message
        self._drawn_s = float("-inf")

    def __enter__(self) -> Self:
        self._screen.__enter__()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if error is None and not self.gone:
            self._draw()  # the last moment may have come just after a picture
        self._screen.__exit__(kind, error, trace)

    @property
    def gone(self) -> bool:
        """Whether the terminal was closed."""
        return self._screen.gone

    @property
    def ready(self) -> bool:
        """Whether somebody sees it: whoever has started the command."""
        return True

    def hear(self, topic: str, data: bytes) -> None:
        """Takes a message of the match."""
        self.moments.hear(topic, data)

    def keys(self, patience_s: float = 0.0) -> list[Key]:
        """The keys pressed since the last call; waits at most this long [s] for them. A terminal that was closed counts as
        quitting."""
        if patience_s > 0.0:
            select.select([self._screen], [], [], patience_s)
        self._screen.stopped()
        return [Key.FINISH] if self._screen.gone else self._screen.pressed()

    def draw(self) -> None:
        """Draws the latest moment, unless it did just now."""
        now_s = monotonic()
        if now_s - self._drawn_s < PICTURE_S:
            return
        self._drawn_s = now_s
        self._draw()

    def _draw(self) -> None:
        columns, rows = self._screen.size
        self._screen.show(match_page(self.moments, self.pace, self.message, columns, rows, self._screen.ascii_only))
