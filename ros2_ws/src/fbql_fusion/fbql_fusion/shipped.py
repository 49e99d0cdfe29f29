"""The policy shipped with this package."""

from __future__ import annotations

from pathlib import Path


def shipped_policy() -> Path:
    """The policy of `fbql` for the shipped trees; the package's README describes how it was trained."""
    return Path(__file__).parent / "policies" / "fbql.npz"
