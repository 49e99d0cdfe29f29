"""Counts and shares in words."""

from __future__ import annotations


def counted(count: int, one: str, several: str = "") -> str:
    """`1 leaf`, `2 leaves`: without `several`, an s is added."""
    return f"{count} {one if count == 1 else several or one + 's'}"


def percent(share: float) -> str:
    """`75 %`, `99.5 %`: to a tenth; 0 and 100 only where it is exactly that, so that no failure is rounded away."""
    tenths = 1000.0 * share
    return f"{tenths / 10 if tenths in (0.0, 1000.0) else min(max(round(tenths), 1), 999) / 10:g} %"
