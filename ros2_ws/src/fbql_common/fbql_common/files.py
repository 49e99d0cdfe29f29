"""Files: written completely or not at all, and read up to a limit with every error in one line."""

from __future__ import annotations

import errno
import fcntl
import os
import shutil
from collections.abc import Generator
from contextlib import contextmanager, suppress
from io import TextIOWrapper
from pathlib import Path
from typing import BinaryIO, TextIO
from uuid import uuid4

from fbql_common.core.errors import BadInput

MAX_NAME_BYTES = 200
"""Longest name of an output: file systems take 255 bytes, endings included."""
DISK_FAILURES = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)
"""The path is right, but the disk is full or fails: the same command may succeed later."""


def remedy(error: OSError) -> str:
    """What to do about a file that can't be written."""
    return "make room there, or choose another place" if error.errno in DISK_FAILURES else "choose another place"


@contextmanager
def atomic_file(path: Path) -> Generator[BinaryIO]:
    """A file to write, which is renamed to `path` at the end of the context: it is complete or absent, even when the disk
    is full or the process is killed, and an existing file is replaced only by a complete one.

    A device or a pipe is written to directly; a link is followed.

    Raises:
        OSError: `path`, which is its `filename`, could not be written; nothing is left behind.
    """
    if path.exists() and not path.is_file() and not path.is_dir():
        with _named(path), path.open("wb") as file:
            yield file
        return
    target = Path(os.path.realpath(path))
    temporary = target.with_name(f".{target.name}.{uuid4().hex}.tmp")
    with _named(path, temporary):
        file = temporary.open("xb")
        try:
            with file:
                yield file
                file.flush()
                os.fsync(file.fileno())
            temporary.replace(target)
        except BaseException:
            with suppress(OSError):
                temporary.unlink(missing_ok=True)
            raise


@contextmanager
def atomic_text(path: Path) -> Generator[TextIO]:
    """As `atomic_file`, for UTF-8 text, whose line ends are written as they are."""
    with atomic_file(path) as file:
        text = TextIOWrapper(file, encoding="utf-8", newline="")
        try:
            yield text
        except BaseException:
            with suppress(OSError):
                text.detach()  # otherwise it would be written when it is garbage-collected
            raise
        text.flush()
        text.detach()


@contextmanager
def _named(path: Path, temporary: Path | None = None) -> Generator[None]:
    """A context in which an OSError about a file names the path that the user knows. The system's error names no file
    if a write fails."""
    try:
        yield
    except OSError as error:
        if error.filename is None or os.fspath(error.filename) == str(temporary):
            error.filename = str(path)
        raise


def write_atomically(path: Path, data: bytes) -> None:
    """Writes a file completely or not at all, as `atomic_file` does.

    Raises:
        OSError: `path`, which is its `filename`, could not be written; nothing is left behind.
    """
    with atomic_file(path) as file:
        file.write(data)


def append_whole(fd: int, data: bytes) -> None:
    """Appends to a file completely or not at all: half a row would be read as a whole one. Raises OSError."""
    size = os.fstat(fd).st_size
    rest = memoryview(data)
    try:
        while rest:
            rest = rest[os.write(fd, rest) :]
    except OSError:
        with suppress(OSError):
            os.ftruncate(fd, size)
        raise


@contextmanager
def output_directory(path: Path, *, is_ours: bool = False) -> Generator[None]:
    """Makes a directory for output, and its parents. If writing inside the context fails, the directories that were
    made are removed again, unless somebody else has put something there.

    Args:
        is_ours: whether a directory that was made is removed with everything in it.

    Raises:
        OSError: it can't be made.
    """
    made: list[Path] = []
    try:
        _make_directories(path, made)
        yield
    except BaseException:
        if is_ours and path in made:
            shutil.rmtree(path, ignore_errors=True)
        for directory in reversed(made):
            with suppress(OSError):
                directory.rmdir()
        raise


@contextmanager
def removed_on_failure(directory: Path) -> Generator[None]:
    """A context for the writing into a directory that was made for it: if that fails, the directory is removed."""
    try:
        yield
    except BaseException:
        shutil.rmtree(directory, ignore_errors=True)
        raise


def _make_directories(path: Path, made: list[Path]) -> None:
    if path.is_dir():
        return
    if path.parent != path:
        _make_directories(path.parent, made)
    try:
        path.mkdir()
    except FileExistsError:  # by another process just now
        if not path.is_dir():
            raise
    else:
        made.append(path)


def check_output(path: Path) -> Path:
    """The path, if it can be a file's name. Files written there mention their name in texts, and append endings to it.

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


def is_locked(path: Path) -> bool:
    """Whether a process holds the exclusive lock (flock) of a file. Raises OSError where the file can't be opened."""
    with path.open("rb") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)  # shared: two that look at once do not see each other
        except BlockingIOError:
            return True
    return False


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
    except ValueError:  # of Python, for a name that no file system takes
        raise BadInput(f"{path}: a null character in it; choose another name") from None
    if len(data) > most_bytes:
        raise BadInput(f"{path}: more than {most_bytes} bytes, the limit for such a file")
    return data


def unreadable(path: Path, error: OSError) -> BadInput:
    """The error to raise for a file that can't be read."""
    if isinstance(error, FileNotFoundError):
        return BadInput(f"{path}: no such file")
    return BadInput(f"{path}: cannot be read ({error.strerror or error})")
