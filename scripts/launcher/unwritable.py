"""What is said, in one line, about an output file that can't be written, and the exit code that goes with it."""

from __future__ import annotations

import errno
import sys
from pathlib import Path

FAILED, BAD_INPUT = 1, 2
_FAILURES = (errno.ENOSPC, errno.EDQUOT, errno.EIO)
"""The path is right, but the disk is full or fails: another time the same command may succeed."""


def unwritable(program: str, path: Path, error: OSError) -> int:
    """Names the path that the user gave, and not a file on the way to it; gives the exit code."""
    # Making the directory README.md/ ends with "File exists", which tells nobody what is wrong.
    reason = "Not a directory" if isinstance(error, FileExistsError) else error.strerror
    print(f"{program}: {path}: cannot be written ({reason})", file=sys.stderr)
    return FAILED if error.errno in _FAILURES else BAD_INPUT
