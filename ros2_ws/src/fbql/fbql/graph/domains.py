"""Which ROS_DOMAIN_ID a command works in: the one that the user sets, else a free one."""

from __future__ import annotations

import os
from collections.abc import Generator
from contextlib import contextmanager

import domain_coordinator
from fbql_common.core.errors import BadInput

MAX_DOMAIN_ID = 232
"""The highest domain that has ports."""


def domain_from() -> int | None:
    """The domain that ROS_DOMAIN_ID names; None if it is not set. Raises BadInput for an impossible one."""
    text = os.environ.get("ROS_DOMAIN_ID", "")
    if not text:
        return None
    if not (text.isascii() and text.isdigit() and int(text) <= MAX_DOMAIN_ID):
        raise BadInput(
            f"ROS_DOMAIN_ID is '{text}'; set a number from 0 to {MAX_DOMAIN_ID}, or unset it to get a free domain"
        )
    return int(text)


@contextmanager
def free_domain() -> Generator[int]:
    """A domain that nobody on this machine uses, reserved until the end. Raises BadInput if there is none."""
    try:
        domain = domain_coordinator.domain_id()
        number = domain.__enter__()
    except RuntimeError:
        raise BadInput("every domain from 1 to 100 is in use on this machine; set ROS_DOMAIN_ID") from None
    try:
        yield number
    finally:
        domain.__exit__(None, None, None)
