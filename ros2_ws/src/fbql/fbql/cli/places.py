"""Where a command finds the checkout, and where its output goes without --out."""

from __future__ import annotations

import os
from datetime import datetime
from pathlib import Path

CHECKOUT = "FBQL_CHECKOUT"
"""The environment variable in which `scripts/NAME.py` names the checkout that it belongs to."""
ROOT = Path(os.environ.get(CHECKOUT) or Path.cwd())
"""The checkout; for an installed command the working directory."""
RUNS = ROOT / "runs"


def command_text(name: str) -> str:
    """How a user types a command here."""
    return f"python3 scripts/{name}.py" if CHECKOUT in os.environ else f"fbql {name}"


def new_path(name: str) -> Path:
    """A path below runs/ that does not exist yet: the time, then `name`."""
    stem = f"{datetime.now():%Y%m%d-%H%M%S}-{name}"
    names = (stem if count == 0 else f"{stem}-{count}" for count in range(1000))
    return next(RUNS / candidate for candidate in names if not (RUNS / candidate).exists())
