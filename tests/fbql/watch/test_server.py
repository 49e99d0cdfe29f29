"""A page for this machine only: whoever asks from elsewhere, or through a page of somebody else's, is refused."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from http.client import HTTPConnection
from time import monotonic
from typing import Any
from urllib.parse import urlsplit

import pytest
from fbql.watch.server import CONNECTION, PageServer
from patience import PATIENCE_S
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection, connect


@pytest.fixture
def server() -> Iterator[PageServer]:
    made = PageServer(lambda host: f"<!doctype html>a page for {host}")
    yield made
    made.close()


def asked(server: PageServer, path: str = "/", **headers: str) -> tuple[int, dict[str, str], str]:
    place = urlsplit(server.address)
    connection = HTTPConnection(place.hostname or "", place.port, timeout=PATIENCE_S)
    connection.request("GET", path, headers=headers)
    answer = connection.getresponse()
    text = answer.read().decode()
    connection.close()
    return answer.status, dict(answer.getheaders()), text


def joined(server: PageServer, **options: Any) -> ClientConnection:
    return connect(f"ws{server.address.removeprefix('http').rstrip('/')}{CONNECTION}", **options)


def said(server: PageServer, count: int) -> list[tuple[Any, str | None]]:
    found: list[tuple[Any, str | None]] = []
    end_s = monotonic() + PATIENCE_S
    while len(found) < count:
        assert monotonic() < end_s, f"only {found} came"
        found += server.said(0.1)
    return found


def test_the_page_is_served_with_what_keeps_it_to_itself(server: PageServer) -> None:
    status, headers, text = asked(server)
    assert (status, text) == (200, f"<!doctype html>a page for {urlsplit(server.address).netloc}")
    assert headers["Content-Type"] == "text/html; charset=utf-8"
    assert headers["Content-Security-Policy"] == "frame-ancestors 'none'"
    assert headers["X-Content-Type-Options"] == "nosniff"
    assert asked(server, Host="localhost:8080")[0] == 200, "through a tunnel"


@pytest.mark.parametrize(
    "host", ["attacker.example", "127.0.0.1.attacker.example:80", "localhost.attacker.example", ""]
)
def test_a_name_that_was_made_to_point_here_is_refused(server: PageServer, host: str) -> None:
    assert asked(server, Host=host)[0] == 403
    assert asked(server, CONNECTION, Host=host)[0] == 403


def test_there_is_no_other_page(server: PageServer) -> None:
    assert asked(server, "/../etc/passwd")[0] == 404


def test_only_this_machine_is_listened_to(server: PageServer) -> None:
    port = urlsplit(server.address).port
    assert urlsplit(server.address).hostname == "127.0.0.1"
    with socket.socket() as other, pytest.raises(OSError):
        other.settimeout(PATIENCE_S)
        other.connect(("127.0.0.2", port))


def test_a_page_of_somebody_else_may_not_connect(server: PageServer) -> None:
    with pytest.raises(InvalidStatus, match="403"), joined(server, origin="http://attacker.example"):
        pass
    assert list(server.said()) == []


def test_what_is_said_comes_in_order_and_what_is_sent_arrives(server: PageServer) -> None:
    with joined(server, origin=server.address.rstrip("/")) as page:
        ((connection, came),) = said(server, 1)
        assert came == ""
        page.send("pause")
        page.send("step")
        assert [words for _, words in said(server, 2)] == ["pause", "step"]
        server.send([connection], "the first")
        server.send([connection], "the second")
        assert [page.recv(PATIENCE_S) for _ in range(2)] == ["the first", "the second"]
    assert said(server, 1) == [(connection, None)]


def test_a_long_message_ends_the_connection_and_nothing_else(server: PageServer) -> None:
    with joined(server) as page:
        page.send("x" * 1000)
        with pytest.raises(ConnectionClosed):
            page.recv(PATIENCE_S)
    assert [words for _, words in said(server, 2)] == ["", None]
    assert asked(server)[0] == 200


def test_the_end_comes_after_all_that_was_sent() -> None:
    server = PageServer(lambda _: "")
    with joined(server) as page:
        ((connection, _),) = said(server, 1)
        for number in range(100):
            server.send([connection], f"{number}" * 1000)
        server.close()
        assert [page.recv(PATIENCE_S)[:3] for _ in range(100)][-1] == "999"
        with pytest.raises(ConnectionClosed):
            page.recv(PATIENCE_S)
