"""Where a command finds the checkout, and where its output goes without --out."""

from __future__ import annotations

import atexit
from contextlib import suppress
from datetime import datetime
from pathlib import Path

from fbql_common.checkout import checkout
from fbql_common.core.errors import BadInput

ROOT = checkout() or Path.cwd()
"""The checkout; for an installed command the working directory."""
RUNS = ROOT / "runs"
_reserved: set[Path] = set()
_form = "fbql {}" if checkout() is None else "python3 scripts/{}.py"


def type_commands_as(form: str) -> None:
    """Sets how commands are typed here; {} stands for the command's name."""
    global _form
    _form = form


def command_text(name: str) -> str:
    """How a user types a command here."""
    return _form.format(name)


def ros2_text() -> str:
    """How a user types ros2 here; in a clone it works before `source scripts/env.sh`, too."""
    return "ros2" if checkout() is None else "scripts/ros2"


def new_path(name: str) -> Path:
    """A path below runs/ that nobody else gets: the time, then `name`.

    It is an empty directory, so that two commands of the same second have one each; if it is still empty when this
    process ends, it is removed.
    """
    stem = f"{datetime.now():%Y%m%d-%H%M%S}-{name}"
    for count in range(1000):
        path = RUNS / (stem if count == 0 else f"{stem}-{count}")
        try:
            path.mkdir(parents=True)
        except FileExistsError:
            continue
        except OSError:
            return path  # whoever writes there says what is wrong
        _reserved.add(path)
        atexit.register(_release, path)
        return path
    raise BadInput(f"{RUNS}: it has a thousand outputs of this second; name one with --out")


def is_reserved(path: Path) -> bool:
    """Whether this process made a directory with `new_path`, and nothing is in it."""
    return path in _reserved and not any(path.iterdir())


def _release(path: Path) -> None:
    with suppress(OSError):
        path.rmdir()
        RUNS.rmdir()
