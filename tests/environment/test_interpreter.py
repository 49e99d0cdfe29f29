"""Finding a Python 3.12, and what an older one gets to see."""

from __future__ import annotations

import ast
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from environment import interpreter
from environment.progress import SetUpError
from environment.set_up import check_path
from places import ROOT


@pytest.mark.parametrize("path", sorted((ROOT / "scripts" / "environment").glob("*.py")), ids=lambda path: path.name)
def test_the_set_up_parses_as_python_3_9(path: Path) -> None:
    ast.parse(path.read_text(), feature_version=(3, 9))


ENTRIES = [path for path in sorted((ROOT / "scripts").glob("*.py")) if "enter(" in path.read_text()]


@pytest.mark.parametrize("entry", ENTRIES, ids=lambda path: path.name)
def test_an_entry_and_the_package_it_imports_first_are_plain_enough_for_python_2_to_read(entry: Path) -> None:
    for path in (entry, ROOT / "scripts" / "environment" / "__init__.py"):
        text = path.read_text(encoding="ascii")  # Python 2 refuses anything else without a coding line
        nodes = list(ast.walk(ast.parse(text)))
        assert not any(isinstance(node, (ast.JoinedStr, ast.AnnAssign, ast.NamedExpr)) for node in nodes)


def other_pythons() -> list[str]:
    found = Path(os.environ.get("PYENV_ROOT") or Path.home() / ".pyenv").glob("versions/*/bin/python")
    return [str(path) for path in sorted(found)]


@pytest.mark.skipif(not other_pythons(), reason="no other Python is installed with pyenv")
def test_a_python_that_is_too_old_gets_one_line_and_exit_code_2() -> None:
    tried = 0
    for python in other_pythons():
        version = subprocess.run(
            [python, "-c", "import sys; print(sys.version_info < (3, 9))"], capture_output=True, text=True, check=True
        )
        if version.stdout.strip() == "True":
            done = subprocess.run(
                [python, "-B", str(ROOT / "scripts" / "test.py")], capture_output=True, text=True, check=False
            )
            assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)
            assert "Python 3.9 or newer" in done.stderr
            tried += 1
    if not tried:
        pytest.skip("no Python older than 3.9 is installed with pyenv")


def fake_python(path: Path, version: str = "3.12.7", **facts: object) -> Path:
    """A program that answers the probe as a Python with these properties would."""
    answer: dict[str, object] = dict.fromkeys(("venv", "ensurepip", "headers"), True) | {
        "rclpy": False,
        "real": str(path),
    }
    answer |= {
        "version": list(map(int, version.split("."))),
        "build": ["CPython", "x86_64", 64],
        "libc": "glibc",
        **facts,
    }
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f"#!/bin/sh\necho '{json.dumps(answer)}'\n")
    path.chmod(0o755)
    return path


@pytest.fixture
def no_running_312(monkeypatch: pytest.MonkeyPatch) -> None:
    """As if the command had been started by another Python than 3.12."""
    monkeypatch.setattr(interpreter.sys, "version_info", (3, 11, 2, "final", 0))


@pytest.mark.usefixtures("no_running_312")
def test_a_shim_that_fails_is_passed_over_for_the_next_candidate(tmp_path: Path) -> None:
    shim = fake_python(tmp_path / "shims" / "python3.12")
    shim.write_text("#!/bin/sh\necho 'pyenv: python3.12: command not found' >&2\nexit 127\n")
    good = fake_python(tmp_path / "bin" / "python3.12")
    path = os.pathsep.join([str(tmp_path / "shims"), str(tmp_path / "bin")])
    found = interpreter.find_interpreter({"PATH": path, "HOME": str(tmp_path)})
    assert found == interpreter.Interpreter(str(good), "3.12.7", True)


@pytest.mark.usefixtures("no_running_312")
def test_the_newest_usable_pyenv_version_is_taken_by_number(tmp_path: Path) -> None:
    for version in ("3.12.2", "3.12.10", "3.12.9", "3.13.0"):
        fake_python(tmp_path / ".pyenv" / "versions" / version / "bin" / "python3.12", version)
    assert interpreter.find_interpreter({"PATH": "", "HOME": str(tmp_path)}).version == "3.12.10"


@pytest.mark.usefixtures("no_running_312")
def test_the_python_that_uv_knows_is_the_last_resort_and_nothing_is_downloaded(tmp_path: Path) -> None:
    good = fake_python(tmp_path / "managed" / "python3.12")
    uv = tmp_path / "bin" / "uv"
    uv.parent.mkdir()
    uv.write_text(f'#!/bin/sh\n[ "$UV_PYTHON_DOWNLOADS" = never ] && [ "$1 $2" = "python find" ] && echo {good}\n')
    uv.chmod(0o755)
    path = os.pathsep.join([str(uv.parent), "/usr/bin", "/bin"])
    usual = [name for name in ("python3.12", "python3", "python") if usable(f"/usr/bin/{name}")]
    if usual:
        pytest.skip("this machine has a usable Python 3.12 in /usr/bin")
    assert interpreter.find_interpreter({"PATH": path, "HOME": str(tmp_path)}).executable == str(good)


def usable(path: str) -> bool:
    return isinstance(interpreter.probe(path, dict(os.environ), with_rclpy=False), interpreter.Interpreter)


@pytest.mark.usefixtures("no_running_312")
@pytest.mark.parametrize(
    ("facts", "reason"),
    [
        ({"venv": False}, "no venv module"),
        ({"ensurepip": False}, "no ensurepip module"),
        ({"headers": False}, "no C headers"),
        ({"libc": "musl"}, "glibc"),
        ({"build": ["PyPy", "x86_64", 64]}, "CPython"),
        ({"build": ["CPython", "i686", 32]}, "32-bit"),
    ],
)
def test_without_a_usable_python_the_line_says_what_to_install_and_what_was_tried(
    tmp_path: Path, facts: dict[str, object], reason: str
) -> None:
    candidate = fake_python(tmp_path / "bin" / "python3.12", **facts)
    with pytest.raises(SetUpError) as caught:
        interpreter.find_interpreter({"PATH": str(candidate.parent), "HOME": str(tmp_path)})
    line = str(caught.value)
    assert str(candidate) in line
    assert reason in line
    assert "pyenv install 3.12" in line
    assert "\n" not in line


@pytest.mark.usefixtures("no_running_312")
def test_other_versions_are_no_candidates_and_no_reason_is_given_for_them(tmp_path: Path) -> None:
    fake_python(tmp_path / "bin" / "python3", "3.13.1")
    with pytest.raises(SetUpError) as caught:
        interpreter.find_interpreter({"PATH": str(tmp_path / "bin"), "HOME": str(tmp_path)})
    assert "Tried" not in str(caught.value)


@pytest.mark.usefixtures("no_running_312")
def test_beside_a_system_ros_the_python_must_import_its_rclpy(tmp_path: Path) -> None:
    fake_python(tmp_path / "a" / "python3.12")
    good = fake_python(tmp_path / "b" / "python3.12", rclpy=True)
    path = os.pathsep.join([str(tmp_path / "a"), str(tmp_path / "b")])
    found = interpreter.find_interpreter({"PATH": path, "HOME": str(tmp_path)}, with_rclpy=True)
    assert found.executable == str(good)


def test_the_python_behind_a_virtual_environment_is_taken_not_the_environment() -> None:
    found = interpreter.probe(sys.executable, dict(os.environ), with_rclpy=False)
    assert isinstance(found, interpreter.Interpreter)
    assert not Path(found.executable).is_relative_to(sys.prefix) or sys.prefix == sys.base_prefix


@pytest.mark.parametrize("machine", [("Linux", "aarch64"), ("Darwin", "arm64")])
def test_another_platform_is_refused_in_one_line(machine: tuple[str, str], monkeypatch: pytest.MonkeyPatch) -> None:
    answer = os.uname_result((machine[0], "host", "1", "1", machine[1]))
    monkeypatch.setattr(interpreter.os, "uname", lambda: answer)
    with pytest.raises(SetUpError, match=rf"x86-64 only; this is {machine[0]} on {machine[1]}"):
        interpreter.check_platform()


@pytest.mark.parametrize("name", ["with space", "naïve", "a:b", "x$y", "comma,"])
def test_a_path_that_the_build_tools_break_on_is_refused(name: str) -> None:
    with pytest.raises(SetUpError, match="Move the checkout"):
        check_path(Path("/home/somebody") / name)
    check_path(Path("/home/some.body-2/c++_x"))
