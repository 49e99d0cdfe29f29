"""Where what a command makes goes when nobody says where."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path

from launcher.options import RUNS


def new_path(name: str) -> Path:
    """A path below runs/ that does not exist yet: the time, then `name`."""
    stem = f"{datetime.now():%Y%m%d-%H%M%S}-{name}"
    names = (stem if count == 0 else f"{stem}-{count}" for count in range(1000))
    return next(RUNS / candidate for candidate in names if not (RUNS / candidate).exists())
