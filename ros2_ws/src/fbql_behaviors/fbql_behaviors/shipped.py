"""The trees shipped with this package."""

from __future__ import annotations

from pathlib import Path


def shipped_trees() -> Path:
    """The directory that holds the tree file NAME.json of each shipped behavior."""
    return Path(__file__).with_name("trees")
