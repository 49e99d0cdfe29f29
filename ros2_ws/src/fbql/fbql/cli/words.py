"""Counts and shares in words."""

from __future__ import annotations


def counted(count: int, one: str, several: str = "") -> str:
    """`1 leaf`, `2 leaves`: without `several`, an s is added."""
    return f"{count} {one if count == 1 else several or one + 's'}"


def percent(share: float) -> str:
    """`75 %`, `99.5 %`: to a tenth; 0 and 100 only where it is exactly that, so that no failure is rounded away."""
    return f"{100.0 * float(share_text(share, 3)):.3g} %"


def share_text(share: float, digits: int) -> str:
    """A share of 1 with this many decimals; 0 and 1 only where it is exactly that."""
    least = 10.0**-digits
    inner = share if share in (0.0, 1.0) else min(max(share, least), 1.0 - least)
    return f"{inner:.{digits}f}"
