"""Which ROS_DOMAIN_ID a command works in: the one that the user sets, else a free one."""

from __future__ import annotations

import os
from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path

import domain_coordinator
from fbql_common.core.errors import BadInput

MAX_DOMAIN_ID = 232
"""The highest domain that has ports."""
_MOST_DIGITS = 9
"""Limit for a ROS_DOMAIN_ID, leading zeros included; Python reads no number of more than 4300 digits."""
_COORDINATED = range(1, 101)
"""The domains that domain_coordinator hands out."""


def domain_from() -> int | None:
    """The domain that ROS_DOMAIN_ID names; None if it is not set. Raises BadInput for an impossible one."""
    text = os.environ.get("ROS_DOMAIN_ID", "")
    if not text:
        return None
    if not (text.isascii() and text.isdigit() and len(text) <= _MOST_DIGITS and int(text) <= MAX_DOMAIN_ID):
        raise BadInput(
            f"ROS_DOMAIN_ID is '{text}'; set a number from 0 to {MAX_DOMAIN_ID}, or unset it to get a free domain"
        )
    return int(text)


@contextmanager
def free_domain() -> Generator[int]:
    """A domain that is unused on this machine, reserved until the process ends. Raises BadInput if there is none."""
    try:
        domain = domain_coordinator.domain_id(_quiet_domains())
        number = domain.__enter__()
    except RuntimeError:
        raise BadInput("every domain from 1 to 100 is in use on this machine; set ROS_DOMAIN_ID") from None
    try:
        yield number
    finally:
        domain.__exit__(None, None, None)


def _quiet_domains() -> Callable[[], int]:
    """Returns, at each call, another domain in which no participant listens; at the end raises StopIteration.

    domain_coordinator knows only the programs that use it. Other graphs show by their UDP ports: those of a domain are
    7400 + 250 * domain and the 249 above (DDSI-RTPS 2.3, section 9.6.1.1).
    """
    used: set[int] = set()
    for table in (Path("/proc/net/udp"), Path("/proc/net/udp6")):
        if table.exists():
            ports = [int(line.split()[1].rpartition(":")[2], 16) for line in table.read_text().splitlines()[1:]]
            used |= {(port - 7400) // 250 for port in ports}
    return iter([domain for domain in _COORDINATED if domain not in used]).__next__
