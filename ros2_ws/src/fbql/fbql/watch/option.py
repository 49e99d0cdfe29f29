"""The option --watch."""

from __future__ import annotations

import argparse

WAYS = ("terminal",)


def add_watch_option(group: argparse._ArgumentGroup, what: str) -> None:
    """Adds --watch [WAY] to a group of options."""
    group.add_argument(
        "--watch",
        nargs="?",
        choices=WAYS,
        const=WAYS[0],
        metavar="|".join(WAYS),
        help=f"{what}; the screen shows the keys to pause, step, go faster and slower, and skip to the next episode",
    )
