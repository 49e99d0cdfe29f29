"""Counts in words."""

from __future__ import annotations


def counted(count: int, one: str, several: str = "") -> str:
    """`1 leaf`, `2 leaves`: without `several`, an s is added."""
    return f"{count} {one if count == 1 else several or one + 's'}"
