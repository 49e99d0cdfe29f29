"""An output file that can't be written."""

from __future__ import annotations

import errno
from pathlib import Path

from fbql.cli.exit_codes import BAD_INPUT, FAILED

_FAILURES = (errno.ENOSPC, errno.EDQUOT, errno.EIO)
"""The path is right, but the disk is full or fails: another time the same command may succeed."""


class Unwritable(Exception):
    """It names the path that the user gave, and not a file on the way to it."""

    def __init__(self, path: Path | str, error: OSError) -> None:
        # Making the directory README.md/ ends with "File exists", which tells nobody what is wrong.
        reason = "Not a directory" if isinstance(error, FileExistsError) else error.strerror or str(error)
        super().__init__(f"{path}: cannot be written ({reason})")
        self.exit_code = FAILED if error.errno in _FAILURES else BAD_INPUT
