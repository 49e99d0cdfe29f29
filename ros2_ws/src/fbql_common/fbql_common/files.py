"""Files: written atomically, and read up to a limit with every error in one line."""

from __future__ import annotations

import os
from pathlib import Path

from fbql_common.core.errors import BadInput

MAX_NAME_BYTES = 200
"""Longest name of an output: file systems take 255 bytes, endings included."""


def write_atomically(path: Path, data: bytes) -> None:
    """Writes a temporary file and renames it to `path`: the file is complete or absent, even when the disk is full
    or the process is killed, and an existing file is replaced only by a complete one.

    Raises:
        OSError: the file could not be written; nothing is left behind.
    """
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        with temporary.open("xb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        temporary.replace(path)
    except OSError:
        temporary.unlink(missing_ok=True)
        raise


def check_output(path: Path) -> Path:
    """The path, if something can be called so. What is written there names itself in texts, and puts endings behind its
    name.

    Raises:
        BadInput: it is not UTF-8, or a part of it is longer than MAX_NAME_BYTES.
    """
    try:
        parts = [part.encode() for part in path.parts]
    except UnicodeEncodeError:
        raise BadInput(f"{path}: not UTF-8; choose another name") from None
    if b"\0" in b"".join(parts):
        raise BadInput(f"{path}: a null character in it; choose another name")
    longest = max(map(len, parts), default=0)
    if longest > MAX_NAME_BYTES:
        raise BadInput(f"{path}: a name of {longest} bytes; choose one of at most {MAX_NAME_BYTES}")
    return path


def read_file(path: Path, most_bytes: int) -> bytes:
    """A file's content.

    Raises:
        BadInput: it can't be read, or holds more than `most_bytes`.
    """
    try:
        with path.open("rb") as file:
            data = file.read(most_bytes + 1)
    except OSError as error:
        raise unreadable(path, error) from None
    if len(data) > most_bytes:
        raise BadInput(f"{path}: more than {most_bytes} bytes, the limit for such a file")
    return data


def unreadable(path: Path, error: OSError) -> BadInput:
    """What to raise for a file that can't be read."""
    if isinstance(error, FileNotFoundError):
        return BadInput(f"{path}: no such file")
    return BadInput(f"{path}: cannot be read ({error.strerror or error})")
