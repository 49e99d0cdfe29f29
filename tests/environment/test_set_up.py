"""What the set-up makes of a home that can't be written, of an odd umask, and of an install space of another layout."""

from __future__ import annotations

import os
import stat
from pathlib import Path

import pytest
from environment.set_up import open_up, readable_as, writable_home


def mode_of(path: Path) -> int:
    return stat.S_IMODE(path.stat().st_mode)


@pytest.mark.parametrize(("root_mode", "file_mode"), [(0o755, 0o644), (0o750, 0o640), (0o700, 0o600)])
def test_files_are_made_as_readable_as_the_checkout_whatever_the_umask(
    tmp_path: Path, root_mode: int, file_mode: int
) -> None:
    tmp_path.chmod(root_mode)
    before = os.umask(0o077)
    try:
        with readable_as(tmp_path):
            (tmp_path / "made").touch()
        (tmp_path / "later").touch()
    finally:
        os.umask(before)
    assert (mode_of(tmp_path / "made"), mode_of(tmp_path / "later")) == (file_mode, 0o600)


def test_private_files_of_a_cache_become_as_readable_as_the_checkout(tmp_path: Path) -> None:
    tmp_path.chmod(0o755)
    folder = tmp_path / "packages" / "inner"
    folder.mkdir(parents=True)
    private, program, link = folder / "private.py", folder / "program", folder / "link"
    private.touch(0o600)
    program.touch()
    program.chmod(0o700)
    link.symlink_to("/nowhere")
    folder.chmod(0o700)
    open_up(tmp_path / "packages", tmp_path)
    assert (mode_of(private), mode_of(program), mode_of(folder)) == (0o644, 0o755, 0o755)
    tmp_path.chmod(0o700)
    private.chmod(0o600)
    open_up(tmp_path / "packages", tmp_path)
    assert mode_of(private) == 0o600


def test_a_home_that_is_not_there_or_can_not_be_written_is_known(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert writable_home({"HOME": str(tmp_path)})
    assert not writable_home({})
    assert not writable_home({"HOME": str(tmp_path / "gone")})
    (tmp_path / ".cache").mkdir()
    monkeypatch.setattr(os, "access", lambda path, _mode: path != tmp_path / ".cache")
    assert not writable_home({"HOME": str(tmp_path)})
