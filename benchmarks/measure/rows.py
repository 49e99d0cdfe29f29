"""The results of a long study, one JSON object per line: read when a study resumes, and appended as they arrive."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Generator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from fbql.cli.output import Unwritable, writing
from fbql_common.files import append_whole, output_directory

Row = Mapping[str, Any]


def read_rows(path: Path) -> list[dict[str, Any]]:
    """The rows of a file, or none if there is no file; a line that is cut off, or not UTF-8, is left out."""
    rows: list[dict[str, Any]] = []
    if path.exists():
        for line in path.read_bytes().splitlines():
            try:
                rows.append(json.loads(line))
            except ValueError:
                continue
    return rows


@contextmanager
def row_appender(path: Path) -> Generator[Callable[[Row], None]]:
    """A function that appends a row, completely or not at all, and passes it to the operating system.

    Raises:
        Unwritable: the file can't be written; what was there before stays.
    """
    with writing(path), output_directory(path.parent):
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_APPEND | os.O_CLOEXEC, 0o644)
    try:
        size = os.fstat(descriptor).st_size
        ends_whole = not size or os.pread(descriptor, 1, size - 1) == b"\n"

        def append(row: Row) -> None:
            nonlocal ends_whole
            begin = "" if ends_whole else "\n"  # the last line was cut off
            try:
                append_whole(descriptor, f"{begin}{json.dumps(row)}\n".encode())
            except OSError as error:
                raise Unwritable(path, error) from None
            ends_whole = True

        yield append
    finally:
        is_empty = not os.fstat(descriptor).st_size
        os.close(descriptor)
        if is_empty:
            path.unlink(missing_ok=True)
