"""What stands in the way of a set-up is said in one line, with exit code 2: by real processes, real full and read-only
file systems, a real closed port.
"""

from __future__ import annotations

import socket
import subprocess
import sys
from pathlib import Path

import pytest
from setup_checkout import command, fresh_environment, in_mount_namespace, make_checkout, run, start, write_package


def only_line(said: subprocess.CompletedProcess[str]) -> str:
    """The one line that is said beside the set-up's progress."""
    assert (said.returncode, said.stdout) == (2, ""), said.stderr
    lines = [line for line in said.stderr.splitlines() if not line.startswith("[set-up ")]
    assert len(lines) == 1, said.stderr
    assert lines[0].startswith("fbql: ")
    return lines[0]


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    """A fresh checkout."""
    return make_checkout(tmp_path / "checkout")


def test_missing_compiler_and_cmake_are_told_before_anything_is_made(checkout: Path, tmp_path: Path) -> None:
    package = checkout / "ros2_ws/src/messages"
    write_package(package)
    manifest = package / "package.xml"
    manifest.write_text(manifest.read_text().replace("ament_python", "ament_cmake"))
    line = only_line(start(checkout, "ros2", "pkg", "list", PATH=str(tmp_path)))
    assert "CMake, a C compiler, a C++ compiler, make, which cannot be found" in line
    assert "apt install build-essential cmake" in line
    assert not (checkout / ".venv").exists()


def test_without_a_network_the_line_says_what_to_check(checkout: Path, tmp_path: Path) -> None:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        closed = f"http://127.0.0.1:{probe.getsockname()[1]}/simple"
    pip = {"PIP_INDEX_URL": closed, "PIP_EXTRA_INDEX_URL": "", "PIP_FIND_LINKS": "", "PIP_CONFIG_FILE": "/dev/null"}
    uv = {"UV_DEFAULT_INDEX": closed, "UV_INDEX": "", "UV_FIND_LINKS": "", "UV_CACHE_DIR": str(tmp_path / "cache")}
    line = only_line(start(checkout, "ros2", "pkg", "list", **pip, **uv, PIP_NO_CACHE_DIR="1"))
    assert "the package index cannot be reached" in line
    assert "start again" in line
    assert not (checkout / ".venv").exists()


def in_mounted_copy(checkout: Path, place: Path, size: str, then: str) -> subprocess.CompletedProcess[str]:
    """Start in a copy of `checkout` on a file system of `size` at `place`, after the shell command `then`."""
    place.mkdir()
    words = " ".join(command(place, "ros2", "pkg", "list"))
    script = f"mount -t tmpfs -o size={size} none {place} && cp -r {checkout}/. {place} && {then} && {words}"
    return in_mount_namespace(script)


@pytest.mark.parametrize("size", ["400k", "6m", "24m"])
def test_a_full_disk_is_told_wherever_it_runs_full(checkout: Path, tmp_path: Path, size: str) -> None:
    line = only_line(in_mounted_copy(checkout, tmp_path / "small", size, "true"))
    assert "no space left on the disk" in line
    assert str(tmp_path / "small") in line


def test_a_checkout_that_cannot_be_written_is_told(checkout: Path, tmp_path: Path) -> None:
    place = tmp_path / "small"
    line = only_line(in_mounted_copy(checkout, place, "50m", f"mount -o remount,ro {place}"))
    assert f"{place}/.setup is not writable" in line


def test_a_place_that_the_build_tools_break_on_is_told(tmp_path: Path) -> None:
    line = only_line(start(make_checkout(tmp_path / "my checkout"), "ros2", "pkg", "list"))
    assert "contains ' '" in line
    assert "Move the checkout" in line


def other_pythons() -> list[Path]:
    """Pythons >= 3.9 of this machine that are not 3.12."""
    places = [Path("/usr/bin/python3"), *Path.home().glob(".pyenv/versions/*/bin/python3")]
    question = "import sys; sys.exit(sys.version_info < (3, 9) or sys.version_info[:2] == (3, 12))"
    return [path for path in places if path.exists() and run([str(path), "-c", question], {}).returncode == 0]


def test_without_a_python_3_12_the_line_says_how_to_get_one(checkout: Path, tmp_path: Path) -> None:
    others = other_pythons()
    if not others:
        pytest.skip("no other Python than 3.12 is installed")
    for python in others:
        arguments = [str(python), str(checkout / "scripts/ros2"), "pkg", "list"]
        line = only_line(run(arguments, {"PATH": str(tmp_path), "HOME": str(tmp_path)}))
        assert "no usable Python 3.12 found" in line


def test_any_python_from_3_9_on_starts_the_set_up_code(checkout: Path) -> None:
    for python in [*other_pythons(), Path(sys.executable)]:
        said = run([str(python), str(checkout / "scripts/ros2"), "run", "--help"], fresh_environment())
        assert (said.returncode, said.stderr) == (0, ""), python
