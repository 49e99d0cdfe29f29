"""The checkout of the repository that this code belongs to, if any."""

from __future__ import annotations

import os
from functools import cache
from pathlib import Path

VARIABLE = "FBQL_CHECKOUT"
"""The environment variable in which `scripts/NAME.py` and `scripts/env.sh` name their checkout."""
LOCKS = {"bags": "bags", "foxglove": "foxglove", "peers": "peers", "rooms": "rooms"}
"""Extra -> its lock file in requirements/, where that is not study.txt."""


@cache
def source_tree() -> Path | None:
    """The checkout that holds this code; None for a package that was installed elsewhere."""
    parents = Path(__file__).resolve().parents
    return next((parent for parent in parents if (parent / "ros2_ws" / "src" / "fbql_common").is_dir()), None)


def checkout() -> Path | None:
    """The checkout whose environment this process runs in; None for an installed program, whatever is in VARIABLE."""
    named, tree = os.environ.get(VARIABLE), source_tree()
    return tree if named and tree is not None and Path(named).resolve() == tree else None


def how_to_install(extra: str) -> str:
    """The command that installs an extra of the distribution here."""
    if checkout() is not None:
        return f"python -m pip install -r requirements/{LOCKS.get(extra, 'study')}.txt"
    return f"pip install '.[{extra}]', in a clone of this project"
