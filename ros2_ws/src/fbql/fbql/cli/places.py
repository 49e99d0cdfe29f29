"""Where a command finds the checkout, and where its output goes without --out."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path

from fbql_common.checkout import checkout

ROOT = checkout() or Path.cwd()
"""The checkout; for an installed command the working directory."""
RUNS = ROOT / "runs"
_form = "fbql {}" if checkout() is None else "python3 scripts/{}.py"


def type_commands_as(form: str) -> None:
    """Sets how commands are typed here; {} stands for the command's name."""
    global _form
    _form = form


def command_text(name: str) -> str:
    """How a user types a command here."""
    return _form.format(name)


def new_path(name: str) -> Path:
    """A path below runs/ that does not exist yet: the time, then `name`."""
    stem = f"{datetime.now():%Y%m%d-%H%M%S}-{name}"
    names = (stem if count == 0 else f"{stem}-{count}" for count in range(1000))
    return next(RUNS / candidate for candidate in names if not (RUNS / candidate).exists())
