"""Files are written completely or not at all, under real faults."""

from __future__ import annotations

import errno
import fcntl
import os
import stat
import threading
from pathlib import Path

import pytest
from fbql_common.core.errors import BadInput
from fbql_common.files import (
    append_whole,
    atomic_file,
    atomic_text,
    is_locked,
    output_directory,
    read_file,
    write_atomically,
)
from file_limit import largest_file


def names_in(directory: Path) -> list[str]:
    return sorted(path.name for path in directory.iterdir())


@pytest.mark.parametrize("size", [0, 100, 100_000], ids=["at the first byte", "at the end", "in the middle"])
def test_a_file_that_does_not_fit_is_named_and_the_old_one_stays(tmp_path: Path, size: int) -> None:
    """What is buffered fails when the file is closed."""
    path = tmp_path / "file"
    path.write_text("old")
    with largest_file(size), pytest.raises(OSError, match="File too large") as raised, atomic_text(path) as file:
        for _ in range(size // 10 + 20):
            file.write("0123456789")
    assert raised.value.filename == str(path)
    assert path.read_text() == "old"
    assert names_in(tmp_path) == ["file"]


def test_a_name_that_no_file_can_have_is_refused_in_one_line() -> None:
    with pytest.raises(BadInput, match="null character"):
        read_file(Path("a\0b"), 100)


def test_an_error_of_the_writer_leaves_the_old_file(tmp_path: Path) -> None:
    write_atomically(tmp_path / "file", b"old")
    with pytest.raises(KeyboardInterrupt), atomic_file(tmp_path / "file") as file:
        file.write(b"new")
        raise KeyboardInterrupt
    assert (tmp_path / "file").read_bytes() == b"old"
    assert names_in(tmp_path) == ["file"]


def test_a_place_that_does_not_exist_is_named_and_not_the_temporary_file(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError) as raised:
        write_atomically(tmp_path / "nowhere" / "file", b"x")
    assert raised.value.filename == str(tmp_path / "nowhere" / "file")


def test_a_device_or_a_pipe_is_written_to_and_never_replaced(tmp_path: Path) -> None:
    with pytest.raises(OSError, match="No space left") as raised:
        write_atomically(Path("/dev/full"), b"x")
    assert (raised.value.errno, raised.value.filename) == (errno.ENOSPC, "/dev/full")
    assert stat.S_ISCHR(Path("/dev/full").stat().st_mode)
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    read: list[bytes] = []
    reader = threading.Thread(target=lambda: read.append(pipe.read_bytes()))
    reader.start()
    write_atomically(pipe, b"through")
    reader.join()
    assert read == [b"through"]
    assert names_in(tmp_path) == ["pipe"]


def test_a_link_is_followed_and_stays(tmp_path: Path) -> None:
    (tmp_path / "there").mkdir()
    (tmp_path / "link").symlink_to("there/file")
    write_atomically(tmp_path / "link", b"x")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "there" / "file").read_bytes() == b"x"


def test_a_row_that_does_not_fit_leaves_the_rows_before(tmp_path: Path) -> None:
    path = tmp_path / "rows"
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_APPEND)
    append_whole(descriptor, b"first\n")
    with largest_file(10), pytest.raises(OSError, match="File too large"):
        append_whole(descriptor, b"second\n")
    append_whole(descriptor, b"third\n")
    os.close(descriptor)
    assert path.read_text() == "first\nthird\n"


def test_directories_that_were_made_are_removed_where_the_writing_fails(tmp_path: Path) -> None:
    (tmp_path / "old").mkdir()
    for path in (tmp_path / "old" / "a" / "b", tmp_path / "old"):
        with pytest.raises(OSError, match="full"), output_directory(path):
            assert path.is_dir()
            raise OSError(errno.ENOSPC, "full")
        assert names_in(tmp_path) == ["old"]
        assert names_in(tmp_path / "old") == []


def test_a_directory_in_which_somebody_else_has_put_something_stays(tmp_path: Path) -> None:
    with pytest.raises(OSError, match="full"), output_directory(tmp_path / "a" / "b"):
        (tmp_path / "a" / "others").touch()
        raise OSError(errno.ENOSPC, "full")
    assert names_in(tmp_path / "a") == ["others"]


def test_a_directory_of_our_own_is_removed_with_what_is_in_it_unless_it_was_there(tmp_path: Path) -> None:
    for present in (False, True):
        path = tmp_path / f"{present}"
        if present:
            path.mkdir()
        with pytest.raises(OSError, match="full"), output_directory(path, is_ours=True):
            (path / "figure").touch()
            raise OSError(errno.ENOSPC, "full")
        assert path.exists() == present


def test_a_temporary_file_of_a_killed_process_is_no_hindrance_and_stays(tmp_path: Path) -> None:
    """Process ids come again, above all in containers."""
    left = tmp_path / f".file.{os.getpid()}.tmp"
    left.write_text("half")
    write_atomically(tmp_path / "file", b"x")
    assert names_in(tmp_path) == [left.name, "file"]


def test_processes_that_look_at_a_lock_at_once_do_not_see_each_other(tmp_path: Path) -> None:
    path = tmp_path / "lock"
    path.touch()
    with path.open("rb") as looking, path.open("rb") as holding:
        fcntl.flock(looking, fcntl.LOCK_SH)
        assert not is_locked(path)
        fcntl.flock(looking, fcntl.LOCK_UN)
        fcntl.flock(holding, fcntl.LOCK_EX)
        assert is_locked(path)
