"""From a fresh checkout to a running executable, and every later start: by real processes, in a small checkout."""

from __future__ import annotations

import os
import resource
import shutil
import signal
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import pytest
from environment import enter, ready
from environment.signals import signals_let_in
from environment.target import lock_entries
from held_signals import until_interrupts_wait
from places import ROOT
from setup_checkout import (
    START_TIMEOUT_S,
    command,
    fresh_environment,
    in_mount_namespace,
    make_checkout,
    run,
    start,
    write_package,
)

SPEAK = ("ros2", "run", "speaker", "speak")


class Said(NamedTuple):
    """How a start ended."""

    code: int
    out: str
    err: str


class FirstStarts(NamedTuple):
    """A checkout that was set up by the first of two starts at once, and what both said."""

    checkout: Path
    said: list[Said]


@pytest.fixture(scope="module")
def first(tmp_path_factory: pytest.TempPathFactory) -> FirstStarts:
    checkout = make_checkout(tmp_path_factory.mktemp("setup") / "checkout")
    processes = [
        subprocess.Popen(
            command(checkout, *SPEAK, word),
            env=fresh_environment(),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        for word in ("one", "two")
    ]
    said: list[Said] = []
    for process in processes:
        out, err = process.communicate(timeout=START_TIMEOUT_S)
        said.append(Said(process.returncode, out, err))
    return FirstStarts(checkout, said)


@pytest.fixture
def checkout(first: FirstStarts) -> Path:
    """The same checkout, set up."""
    return first.checkout


def test_the_first_command_sets_up_and_then_runs_with_only_its_own_words_on_stdout(first: FirstStarts) -> None:
    assert [said[:2] for said in first.said] == [(7, "speaks one\n"), (7, "speaks two\n")], first.said


def test_of_two_started_at_once_one_does_the_work_and_the_other_waits_for_it(first: FirstStarts) -> None:
    waited = ["another set-up of this checkout is running" in said.err for said in first.said]
    worked = ["installing" in said.err for said in first.said]
    assert sorted(waited) == [False, True]
    assert worked == [not waits for waits in waited]


def test_the_work_is_announced_in_numbered_steps(first: FirstStarts) -> None:
    worker = next(said.err for said in first.said if "installing" in said.err)
    for step in ("[set-up 1/3] making .venv", "[set-up 2/3] installing", "[set-up 3/3] building speaker"):
        assert step in worker


def test_the_second_start_says_nothing_and_takes_no_second(checkout: Path) -> None:
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    for _ in range(5):
        said = start(checkout, *SPEAK)
        assert (said.stdout, said.stderr) == ("speaks\n", "")
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    # Of the processor's time: the machine may be busy.
    assert after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime < 5 * 1.0


def test_closed_standard_streams_are_no_hindrance_to_a_build(checkout: Path) -> None:
    (checkout / "ros2_ws/src/speaker/setup.cfg").open("a").write("\n")
    words = " ".join(command(checkout, *SPEAK))
    said = run(["sh", "-c", f"{words} <&- 2>&-"], fresh_environment())
    assert (said.returncode, said.stdout, said.stderr) == (7, "speaks\n", "")


def test_a_checkout_that_is_set_up_starts_from_a_read_only_file_system(checkout: Path) -> None:
    words = " ".join(command(checkout, *SPEAK))
    said = in_mount_namespace(
        f"mount --bind {checkout} {checkout} && mount -o remount,bind,ro {checkout} && "
        f"! touch {checkout}/x 2> /dev/null && {words}"
    )
    assert (said.returncode, said.stdout, said.stderr) == (7, "speaks\n", "")


def test_an_edited_a_new_and_a_removed_module_are_taken_up_by_the_next_start_without_a_build(checkout: Path) -> None:
    source = checkout / "ros2_ws/src/speaker/speaker"
    code = source / "speak.py"
    before = code.read_text()
    code.write_text("from speaker.words import WORD\ndef main():\n    print(WORD)\n")
    (source / "words.py").write_text("WORD = 'changed'\n")
    said = start(checkout, *SPEAK)
    assert (said.returncode, said.stdout, said.stderr) == (0, "changed\n", "")
    code.write_text(before)
    (source / "words.py").unlink()
    assert start(checkout, *SPEAK, "again").stdout == "speaks again\n"


def test_a_new_package_is_built_and_a_removed_one_disappears(checkout: Path) -> None:
    source = checkout / "ros2_ws/src"
    write_package(source / "second")
    (source / "second/package.xml").write_text("<package>")
    said = start(checkout, "ros2", "pkg", "executables")
    assert (said.returncode, said.stderr.count("\n")) == (2, 1)
    assert f"{source}/second/package.xml is not XML" in said.stderr
    write_package(source / "second")
    said = start(checkout, "ros2", "pkg", "executables")
    assert said.stdout == "second speak\nspeaker speak\n", said.stderr
    assert "building second ..." in said.stderr
    shutil.rmtree(source / "second")
    assert start(checkout, "ros2", "pkg", "executables").stdout == "speaker speak\n"
    assert not (checkout / "ros2_ws/install/second").exists()
    assert not (checkout / "ros2_ws/build/second").exists()


def test_a_package_that_does_not_build_is_shown_with_its_error_and_the_log(checkout: Path) -> None:
    setup = checkout / "ros2_ws/src/speaker/setup.py"
    before = setup.read_text()
    try:
        setup.write_text("raise ValueError('no such version')\n")
        said = start(checkout, *SPEAK)
    finally:
        setup.write_text(before)
    assert (said.returncode, said.stdout) == (2, "")
    assert "ValueError: no such version" in said.stderr
    assert said.stderr.splitlines()[-1].startswith("fbql: building speaker failed. Fix the problem shown above")
    assert str(checkout / ".setup/log/build.txt") in said.stderr
    assert start(checkout, *SPEAK, "mended").stdout == "speaks mended\n"


def broken_modules(place: Path) -> Path:
    """A directory with modules under the names of locked packages, which end a program that imports one."""
    place.mkdir(parents=True)
    for name in ("colcon_core", "setuptools", "yaml", "pip", "venv"):
        (place / f"{name}.py").write_text(f"raise SystemExit('this is not the locked {name}')\n")
    return place


@pytest.fixture
def foreign_settings(tmp_path: Path) -> dict[str, str]:
    """The variables of somebody with other Pythons, and with habits in colcon that would break our build."""
    modules = [broken_modules(tmp_path / place) for place in ("lib/python3.9/site-packages", "mine")]
    settings = tmp_path / ".colcon/defaults.yaml"
    settings.parent.mkdir()
    settings.write_text("build:\n  merge-install: true\n  base-paths: [/nowhere]\n")
    return {
        "PYTHONPATH": os.pathsep.join(map(str, modules)),
        "COLCON_DEFAULTS_FILE": str(settings),
        "COLCON_HOME": str(settings.parent),
        "COLCON_LOG_PATH": "/nowhere",
    }


def test_modules_and_colcon_settings_of_the_users_own_change_neither_the_build_nor_what_is_imported(
    checkout: Path, foreign_settings: dict[str, str]
) -> None:
    (checkout / "ros2_ws/src/speaker/setup.cfg").open("a").write("\n")
    said = start(checkout, *SPEAK, "on", **foreign_settings)
    assert said.stdout == "speaks on\n", said.stderr
    assert "building speaker" in said.stderr
    assert (checkout / "ros2_ws/install/.colcon_install_layout").read_text().strip() == "isolated"
    script = f"source {checkout}/scripts/env.sh; python -c 'import yaml, setuptools; print(yaml.__file__)'"
    said = in_shell("bash", script, **foreign_settings)
    assert said.stdout == f"{checkout}/.venv/lib/python3.12/site-packages/yaml/__init__.py\n", said.stderr
    assert start(checkout, *SPEAK).stderr == ""


def test_test_py_adds_the_test_tools_once_and_hands_its_arguments_to_pytest(checkout: Path) -> None:
    (checkout / "tests").mkdir()
    (checkout / "tests/test_speaker.py").write_text(
        "import pytest\nfrom speaker import speak\n"
        "def test_it():\n    assert speak.main() == 7\n"
        "@pytest.mark.long\ndef test_long():\n    raise AssertionError\n"
    )
    (checkout / "pyproject.toml").write_text('[tool.pytest.ini_options]\nmarkers = ["long: long"]\n')
    said = start(checkout, "test.py", "-q")
    assert said.returncode == 0, said.stdout + said.stderr
    assert "1 passed, 1 deselected" in said.stdout
    assert "installing" in said.stderr
    said = start(checkout, "test.py", "-q", "-m", "long")
    assert (said.returncode, said.stderr) == (1, "")


def test_a_changed_lock_is_installed_into_the_same_environment_and_keeps_the_test_tools(checkout: Path) -> None:
    assert start(checkout, "test.py", "--version").returncode == 0
    made = (checkout / ".venv/pyvenv.cfg").stat()
    new = lock_entries((ROOT / "requirements/test.txt").read_text())["sortedcontainers"]
    with (checkout / "requirements/run.txt").open("a") as lock:
        lock.write(f"{new}\n")
    said = start(checkout, *SPEAK, "on")
    assert said.stdout == "speaks on\n", said.stderr
    assert "installing" in said.stderr
    assert "building speaker" in said.stderr
    assert "making .venv" not in said.stderr
    assert (checkout / ".venv/pyvenv.cfg").stat().st_ino == made.st_ino
    assert (checkout / ".venv/lib/python3.12/site-packages/sortedcontainers").is_dir()
    assert start(checkout, "test.py", "--version").stderr == ""


def test_a_moved_checkout_is_set_up_again_in_its_new_place(checkout: Path, tmp_path: Path) -> None:
    moved = tmp_path / "moved"
    shutil.copytree(checkout, moved, symlinks=True)
    said = start(moved, *SPEAK, "here")
    assert said.stdout == "speaks here\n", said.stderr
    assert "making .venv" in said.stderr
    shebang = (moved / "ros2_ws/install/speaker/lib/speaker/speak").read_text().splitlines()[0]
    assert shebang == f"#!{moved}/.venv/bin/python"


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (("run", "nothing", "speak"), "Package 'nothing' not found"),
        (("pkg", "executables", "nothing"), "Package 'nothing' not found"),
        (("run", "speaker", "nothing"), "No executable found"),
        (("pkg", "prefix", "nothing"), "Package not found"),
    ],
)
def test_what_is_not_there_is_answered_as_ros2_does(checkout: Path, arguments: tuple[str, ...], line: str) -> None:
    said = start(checkout, "ros2", *arguments)
    assert (said.returncode, said.stdout, said.stderr) == (1, "", f"{line}\n")


def test_the_lookup_prints_what_ros2_prints(checkout: Path) -> None:
    prefix = checkout / "ros2_ws/install/speaker"
    assert start(checkout, "ros2", "pkg", "prefix", "speaker").stdout == f"{prefix}\n"
    assert start(checkout, "ros2", "pkg", "list").stdout == "speaker\n"
    assert start(checkout, "ros2", "pkg", "executables", "speaker").stdout == "speaker speak\n"
    full = start(checkout, "ros2", "pkg", "executables", "--full-path")
    assert full.stdout == f"{prefix}/lib/speaker/speak\n"


@pytest.mark.parametrize("words", [("pkg", "list"), ("--help",), ("run", "--help"), ("pkg",)], ids=" ".join)
def test_a_reader_that_left_is_no_error(checkout: Path, words: tuple[str, ...]) -> None:
    read, write = os.pipe()
    os.close(read)
    environ = fresh_environment()
    environ.pop("PYTHONUNBUFFERED", None)
    said = subprocess.run(
        command(checkout, "ros2", *words), env=environ, stdout=write, stderr=subprocess.PIPE, text=True, check=False
    )
    os.close(write)
    assert (said.returncode, said.stderr) == (0, "")


def test_a_full_disk_is_one_line(checkout: Path) -> None:
    with Path("/dev/full").open("w") as full:
        words = command(checkout, "ros2", "pkg", "list")
        said = subprocess.run(
            words, env=fresh_environment(), stdout=full, stderr=subprocess.PIPE, text=True, check=False
        )
    assert said.returncode == 1
    assert said.stderr.count("\n") == 1
    assert "stdout: cannot be written (No space left on device)" in said.stderr


@pytest.mark.parametrize("arguments", [("run", "{}", "x"), ("pkg", "executables", "{}"), ("pkg", "{}"), ("{}",)])
def test_a_name_is_never_printed_raw(checkout: Path, arguments: tuple[str, ...]) -> None:
    said = start(checkout, "ros2", *(word.format("x\nfbql: all is well\x1b[31m") for word in arguments))
    assert said.returncode in (1, 2)
    assert "x\\nfbql: all is well\\x1b[31m" in said.stderr


def test_run_hands_over_arguments_as_they_are_and_puts_a_prefix_before(checkout: Path) -> None:
    said = start(checkout, *SPEAK, "--ros-args", "-r", "__ns:=/a b", "--help")
    assert said.stdout == "speaks --ros-args -r __ns:=/a b --help\n"
    said = start(checkout, "ros2", "run", "--prefix", "env -u HOME echo", "speaker", "speak", "x")
    assert said.stdout == f"{checkout}/ros2_ws/install/speaker/lib/speaker/speak x\n"


def test_other_verbs_need_a_real_ros2_and_help_needs_nothing(tmp_path: Path) -> None:
    fresh = make_checkout(tmp_path / "fresh")
    said = start(fresh, "ros2", "service", "list")
    assert (said.returncode, said.stdout, said.stderr.count("\n")) == (2, "", 1)
    assert "needs a real ros2" in said.stderr
    said = start(fresh, "ros2", "run", "--help")
    assert said.returncode == 0
    assert "package_name" in said.stdout
    assert not (fresh / ".setup").exists()


SHELLS = [name for name in ("bash", "zsh") if shutil.which(name)]


def in_shell(shell: str, script: str, **changes: str) -> subprocess.CompletedProcess[str]:
    """Run `script` in a shell that reads no start-up files."""
    plain = {"bash": ["--norc", "--noprofile"], "zsh": ["-f"]}[shell]
    return run([str(shutil.which(shell)), *plain, "-c", script], fresh_environment(**changes))


@pytest.mark.parametrize("shell", SHELLS)
def test_env_sh_gives_a_shell_the_environment_and_leaves_its_options_alone(checkout: Path, shell: str) -> None:
    said = in_shell(
        shell,
        f"set -u; before=$-; cd {checkout}/scripts; source ./env.sh; echo $?; [ $- = $before ] && echo same; cd /\n"
        "command -v python ros2; ros2 run speaker speak there; python -c 'import speaker; print(speaker.__file__)'",
    )
    venv, site = checkout / ".venv/bin", checkout / "ros2_ws/build/speaker"
    expected = f"0\nsame\n{venv}/python\n{checkout}/scripts/ros2\nspeaks there\n{site}/speaker/__init__.py\n"
    assert said.stdout == expected, said.stderr


@pytest.mark.parametrize("shell", SHELLS)
def test_env_sh_says_what_is_wrong_and_leaves_the_shell_alive_and_as_it_was(checkout: Path, shell: str) -> None:
    script = f'PATH=/nowhere; source {checkout}/scripts/env.sh; echo "$? $PATH ${{AMENT_PREFIX_PATH-none}}"'
    said = in_shell(shell, script)
    assert said.stdout == "1 /nowhere none\n"
    assert said.stderr == "fbql: there is no python3 on PATH; install Python 3.12 and source this again\n"


@pytest.mark.parametrize("shell", SHELLS)
def test_env_sh_must_be_sourced(checkout: Path, shell: str) -> None:
    said = run([str(shutil.which(shell)), str(checkout / "scripts/env.sh")], fresh_environment())
    assert (said.returncode, said.stdout) == (1, "")
    assert "source" in said.stderr


def test_a_real_ros2_comes_first_with_a_shell_that_has_one(checkout: Path, tmp_path: Path) -> None:
    real = tmp_path / "ros2"
    real.write_text("#!/bin/sh\necho real\n")
    real.chmod(0o755)
    path = os.pathsep.join([fresh_environment()["PATH"], str(tmp_path)])
    assert in_shell("bash", f"source {checkout}/scripts/env.sh; ros2", PATH=path).stdout == "real\n"


class Asked(Exception):
    """Which purpose an environment was asked for."""


@pytest.mark.parametrize(
    ("purpose", "argv", "asked"),
    [
        ("study", ["paper"], "study"),
        ("study", ["paper", "--help"], "run"),
        ("bags", ["it", "--bag", "drive"], "bags"),
        ("bags", ["it", "--bag", "drive", "-h"], "run"),
        ("test", ["--help"], "test"),
    ],
)
def test_help_alone_installs_no_study_packages(
    purpose: str, argv: list[str], asked: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(purpose: str) -> None:
        raise Asked(purpose)

    monkeypatch.setattr(ready, "environment_or_exit", refuse)
    monkeypatch.setattr(sys, "argv", ["command.py", *argv])
    monkeypatch.delenv("_FBQL_ENTERED", raising=False)
    with signals_let_in(), pytest.raises(Asked, match=f"^{asked}$"):
        enter("experiment", purpose=purpose)


@pytest.mark.parametrize(
    ("program", "words", "code", "said"),
    [
        ("scripts/bringup.py", (), 1, "bringup.py: ended by SIGINT; the match had not begun\n"),
        ("scripts/tree.py", ("explain", "ball_seeking"), 130, "tree.py: interrupted\n"),
        ("scripts/ros2", ("run", "fbql", "tree", "explain", "ball_seeking"), 130, "tree: interrupted\n"),
        ("benchmarks/kills.py", ("--help",), 130, ""),
    ],
)
def test_an_interrupt_while_a_command_is_loaded_waits_and_ends_it_without_a_traceback(
    tmp_path: Path, program: str, words: tuple[str, ...], code: int, said: str
) -> None:
    command = [sys.executable, str(ROOT / program), *words]
    popen = subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    until_interrupts_wait(popen)
    popen.send_signal(signal.SIGINT)
    stdout, stderr = popen.communicate(timeout=START_TIMEOUT_S)
    assert (popen.returncode, stdout, stderr) == (code, "", said)
