"""A match in a browser, live or replayed: the page of the report, which receives the steps while it is open."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from os import environ
from time import monotonic
from types import TracebackType
from typing import Self

from fbql_behaviors.core.tree import Tree
from fbql_common.terminal.keys import Key
from fbql_recording.core.columns import Recorded
from fbql_recording.core.steps import Step

from fbql.report.page import controllers_html, filled, senses, tile_values, tiles_html
from fbql.report.texts import html, json_for_html, plain
from fbql.watch.feed import Feed
from fbql.watch.moments import Moments
from fbql.watch.pace import Pace
from fbql.watch.server import CONNECTION, Connection, PageServer

PATIENCE_S = 20.0
"""How long a match waits for the page to be opened [s]."""
ORDERS: Mapping[str, Key] = {
    "pause": Key.PAUSE,
    "step": Key.STEP,
    "faster": Key.FASTER,
    "slower": Key.SLOWER,
    "next": Key.NEXT,
}
"""The requests of a page."""
_PICTURE_S = 1 / 20
_ALONE_S = 3.0
"""How long a paused match waits for a page after the last one was closed: as long as loading it again takes [s]."""
_SCREENS = ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER")
"""Environment variables that indicate that a browser can be opened here."""


class BrowserPage:
    """A page between `with` and its end, and the match on it; served from the moment it is made.

    Making it raises BadInput where nothing can be served.

    Args:
        recorded: which messages a step of the match has.
        trees: those that behaviors may answer with.
        title: what is watched.
        headline: the same in a few words.
        controllers: who decides.
        shown: the behavior that is demonstrated, where nobody decides.
        say: prints a line for people.
    """

    gone = False
    """Whether nobody can see it any more; a page can be opened again."""

    def __init__(
        self,
        recorded: Recorded,
        trees: Iterable[Tree],
        title: str,
        headline: str,
        say: Callable[[str], None],
        controllers: Iterable[str] = (),
        shown: str = "",
    ) -> None:
        trees = list(trees)
        self.moments = Moments(trees)
        self.pace: Pace | None = None
        """The pace that the page shows and changes; None: the match's own."""
        self.message = ""
        """Not shown: the note is for a terminal."""
        self._feed = Feed(recorded, trees)
        self._say = say
        self._pages: set[Connection] = set()
        self._new: list[Connection] = []
        self._sent_s = float("-inf")
        self._waits_until_s = float("inf")
        self._alone_s = 0.0
        parts = {
            "title": html(title),
            "headline": html(headline),
            "tiles": "" if shown else tiles_html(tile_values([])),
            "notes": '<p class="live" id="live" role="status">Live.</p>\n'
            '<noscript><p class="trouble">This page needs JavaScript.</p></noscript>',
            "controllers": controllers_html(controllers),
            "senses": senses(trees),
            "episodes": "",
            "about": "",
            "data": json_for_html({**self._feed.data(), "shown": plain(shown)}),
            "blocks": "",
        }
        self._server = PageServer(partial(_page, parts))
        self.address = self._server.address

    def __enter__(self) -> Self:
        self._waits_until_s = monotonic() + PATIENCE_S
        opens = any(environ.get(name) for name in _SCREENS)
        if opens:
            _open(self.address)
        self._say(f"{'watch it in your browser' if opens else 'watch it: open this in a browser'}: {self.address}")
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._feed.settle()
        self._tell()
        self._server.close()

    @property
    def ready(self) -> bool:
        """Whether the match need not wait any more: a page was opened, or will not be."""
        return monotonic() >= self._waits_until_s

    def keys(self, patience_s: float = 0.0) -> list[Key]:
        """The requests since the last call; waits at most this long [s] for one."""
        keys: list[Key] = []
        for page, words in self._server.said(patience_s):
            if words is None:
                self._pages.discard(page)
                self._new = [each for each in self._new if each is not page]
                self._alone_s = monotonic()
            elif not words:
                self._new.append(page)
                self._waits_until_s = 0.0
            elif words in ORDERS:
                keys.append(ORDERS[words])
        alone = not (self._pages or self._new) and monotonic() - self._alone_s > _ALONE_S
        return [Key.PAUSE] if alone and self.pace is not None and self.pace.is_paused else keys

    def hear(self, topic: str, data: bytes) -> None:
        """Takes a message of the match."""
        self.moments.hear(topic, data)
        self._feed.hear(topic, data)

    def take(self, step: Step) -> None:
        """Takes a step."""
        self._feed.take(step)

    def draw(self) -> None:
        """Sends pages what is new, unless it did so just now."""
        now_s = monotonic()
        if now_s - self._sent_s >= _PICTURE_S:
            self._sent_s = now_s
            self._tell()

    def _tell(self) -> None:
        if not self._pages:
            self._feed.skip()
        elif news := self._feed.news(self.pace):
            self._server.send(self._pages, news)
        if self._new:
            self._server.send(self._new, self._feed.all(self.pace))
            self._pages |= set(self._new)
            self._new.clear()


def _page(parts: Mapping[str, str], host: str) -> str:
    return filled("live.js", f"ws://{host}{CONNECTION}", **parts)


def _open(address: str) -> None:
    """Opens a browser. Whatever it prints stays out of ours, and it may run on after us."""
    subprocess.Popen(
        [sys.executable, "-m", "webbrowser", address],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
