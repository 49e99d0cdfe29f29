"""One set-up of a checkout at a time."""

from __future__ import annotations

import contextlib
import fcntl
import os
from collections.abc import Generator
from pathlib import Path

from .progress import say


@contextlib.contextmanager
def exclusive(path: Path) -> Generator[int, None, None]:
    """Hold the lock file at `path`; yields its descriptor. Waits, with a message, while another process holds it.

    The lock belongs to the open file (flock), not to this process: a child that inherits the descriptor holds it too.
    So when this process is killed, its installer or compiler, still writing, keeps the next set-up waiting.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            holder = os.pread(descriptor, 32, 0).decode(errors="replace").strip()
            say(f"another set-up of this checkout is running (process {holder or 'unknown'}); waiting for it ...")
            fcntl.flock(descriptor, fcntl.LOCK_EX)
        os.truncate(descriptor, 0)
        os.pwrite(descriptor, f"{os.getpid()}\n".encode(), 0)
        yield descriptor
    finally:
        os.close(descriptor)
