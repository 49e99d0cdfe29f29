"""The option --watch."""

from __future__ import annotations

import argparse

from fbql_common.terminal.screen import require_terminal

WAYS = ("terminal", "browser")


def add_watch_option(group: argparse._ArgumentGroup, what: str) -> None:
    """Adds --watch [WAY] to a group of options."""
    group.add_argument(
        "--watch",
        nargs="?",
        choices=WAYS,
        const=WAYS[0],
        metavar="|".join(WAYS),
        help=f"{what}: in this terminal, or as a page in a browser on this machine; the screen shows the keys to pause, step, "
        "go faster and slower, and skip to the next episode",
    )


def require_way(way: str | None) -> None:
    """Raises BadInput where a match can't be watched in this way."""
    if way == "terminal":
        require_terminal()
