"""A page and a connection to it, served to this machine only, in a thread of its own.

It listens on `127.0.0.1` only. A page from elsewhere can't reach the match through a person's browser: a request must name
this machine as the host (otherwise, any name that resolves to it would do), and a connection must come from the page served
here.
"""

from __future__ import annotations

import asyncio
import logging
import re
from collections.abc import Callable, Collection, Iterator
from queue import Empty, SimpleQueue
from threading import Thread
from typing import Any

from fbql_common.core.errors import BadInput

HOST = "127.0.0.1"
CONNECTION = "/live"
"""Where the page connects to."""
_HERE = re.compile(r"(?:127\.0\.0\.1|localhost)(?::\d{1,5})?\Z")
_LONGEST_ORDER = 64
_BEHIND = 16 * 2**20
"""A page that is this far behind is disconnected [bytes]; when it is opened again, it gets everything anew."""
_PATIENCE_S = 5.0

Connection = Any
"""A page that is open."""


class PageServer:
    """Serves a page, and passes messages on in both directions.

    Args:
        page: the page for a host as the browser names it.

    Raises:
        BadInput: there is no such server library, or nothing can be served.
    """

    def __init__(self, page: Callable[[str], str]) -> None:
        try:
            from websockets.asyncio import server
        except ImportError:
            raise BadInput(
                "--watch browser needs websockets >= 14, which is not installed: pip install 'websockets>=14'"
            ) from None
        self._library: Any = server
        self._page = page
        self._said: SimpleQueue[tuple[Connection, str | None]] = SimpleQueue()
        self._loop = asyncio.new_event_loop()
        self._ended = asyncio.Event()
        started: SimpleQueue[int | OSError] = SimpleQueue()
        self._thread = Thread(target=self._run, args=(started,), name="page server", daemon=True)
        self._thread.start()
        port = started.get()
        if isinstance(port, OSError):
            raise BadInput(f"--watch browser: nothing can be served on {HOST} ({port.strerror})")
        self.address = f"http://{HOST}:{port}/"
        """The address to open."""

    def send(self, to: Collection[Connection], text: str) -> None:
        """Sends a text to pages; returns at once."""
        if to:
            self._loop.call_soon_threadsafe(self._send, tuple(to), text)

    def said(self, patience_s: float = 0.0) -> Iterator[tuple[Connection, str | None]]:
        """The messages of pages; waits at most this long [s] for the first.

        "" means that a page has just been opened, None that one was closed.
        """
        try:
            yield self._said.get(timeout=patience_s) if patience_s > 0.0 else self._said.get_nowait()
            while True:
                yield self._said.get_nowait()
        except Empty:
            return

    def close(self) -> None:
        """Tells every page that the match has ended, once it has received everything."""
        self._loop.call_soon_threadsafe(self._ended.set)
        self._thread.join(_PATIENCE_S)

    def _run(self, started: SimpleQueue[int | OSError]) -> None:
        try:
            self._loop.run_until_complete(self._serve(started))
        finally:
            self._loop.close()

    async def _serve(self, started: SimpleQueue[int | OSError]) -> None:
        silent = logging.Logger("page server", logging.CRITICAL + 1)
        try:
            serving = await self._library.serve(
                self._talk, HOST, 0, process_request=self._answer, compression=None, max_size=_LONGEST_ORDER,
                close_timeout=_PATIENCE_S / 2, logger=silent,
            )  # fmt: skip
        except OSError as error:
            started.put(error)
            return
        started.put(serving.sockets[0].getsockname()[1])
        await self._ended.wait()
        serving.close()
        await serving.wait_closed()

    async def _talk(self, connection: Connection) -> None:
        self._said.put((connection, ""))
        try:
            async for text in connection:
                self._said.put((connection, str(text)))
        finally:
            self._said.put((connection, None))

    def _send(self, to: Collection[Connection], text: str) -> None:
        for connection in to:
            if connection.transport.get_write_buffer_size() > _BEHIND:
                connection.transport.abort()
        self._library.broadcast(to, text)

    def _answer(self, connection: Connection, request: Any) -> Any:
        """The answer to a request; None if it may connect."""
        host = request.headers.get("Host", "")
        if not _HERE.match(host):
            return connection.respond(403, "This page is only for the machine that serves it.\n")
        if request.path == CONNECTION:
            foreign = request.headers.get("Origin", f"http://{host}") != f"http://{host}"
            return connection.respond(403, "Only the page that is served here may connect.\n") if foreign else None
        if request.path != "/":
            return connection.respond(404, "There is only one page here: /\n")
        response = connection.respond(200, self._page(host))
        del response.headers["Content-Type"]
        response.headers.update(
            {
                "Content-Type": "text/html; charset=utf-8",
                "Content-Security-Policy": "frame-ancestors 'none'",
                "X-Content-Type-Options": "nosniff",
                "Referrer-Policy": "no-referrer",
                "Cross-Origin-Resource-Policy": "same-origin",
                "Cache-Control": "no-store",
            }
        )
        return response
