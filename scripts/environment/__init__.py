"""The environment set-up: what stands between `git clone` and a running command.

Runs under any Python >= 3.9 with the standard library alone. `enter(NAME)` makes sure that the environment is there
(Python 3.12, the hash-locked packages, the built workspace), then continues as the command NAME in it.
This file itself must parse under every Python since 2.7, so that an old one prints one line and no traceback.
"""

import sys

if sys.version_info < (3, 9):  # noqa: UP036 - this is the line that tells
    sys.stderr.write(
        "fbql: this command needs Python 3.9 or newer to start (it then finds Python 3.12 by itself), "
        "but this Python is older. Start it with a newer python3.\n"
    )
    sys.exit(2)

from .enter import enter, enter_ros2

__all__ = ["enter", "enter_ros2"]
