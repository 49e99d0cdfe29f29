"""Whatever the environment variables hold: the set-up computes those of our processes, or reports the error in one
line."""

from __future__ import annotations

import os
import random
import subprocess
from pathlib import Path

import pytest
from environment.__main__ import exports
from environment.interpreter import candidates
from environment.progress import SetUpError
from environment.ros2 import find_packages, real_ros2
from environment.target import split_path, target_for
from environment.variables import SEARCH_PATHS, build_environment, process_environment, tool_environment
from fuzzing import dice, odd_variable
from patience import PATIENCE_S
from places import ROOT
from setup_target import made_target, packages

NAMES = (
    *SEARCH_PATHS, "HOME", "PYENV_ROOT", "COLCON_PREFIX_PATH", "COLCON_DEFAULTS_FILE", "ROS_DISTRO", "ROS_VERSION",
    "ROS_PACKAGE_PATH", "RMW_IMPLEMENTATION", "PYTHONHOME", "VIRTUAL_ENV", "XDG_CACHE_HOME", "TERM", "FBQL_CHECKOUT",
    "_ROS_WHEELS_BOOTSTRAP_COMPLETE", "CXX", "ROS_AUTOMATIC_DISCOVERY_RANGE", "PYTHONUNBUFFERED",
)  # fmt: skip


def odd_environ(rng: random.Random, place: Path) -> dict[str, str]:
    environ: dict[str, str] = {"PATH": "/usr/bin:/bin"}
    for _ in range(rng.randrange(1, 6)):
        name = rng.choice(NAMES)
        parts = [rng.choice((odd_variable(rng), str(place), str(ROOT), "/opt/ros/humble", "", "/usr/lib/python3.10"))
                 for _ in range(rng.choice((1, 1, 3)))]  # fmt: skip
        environ[name] = ":".join(parts)
        if name == "ROS_DISTRO":
            environ[name] = rng.choice(("jazzy", "humble", odd_variable(rng)))
    return environ


def test_any_variables_give_an_environment_in_which_ours_come_first(tmp_path, capsys):
    made = made_target(tmp_path / "checkout")
    for rng in dice(150):
        environ = odd_environ(rng, tmp_path)
        before = dict(environ)
        try:
            target = target_for(made.root, environ)
            found = process_environment(target, environ, packages())
            build_environment(target, environ), tool_environment(environ)
        except SetUpError as error:
            assert str(error).isprintable()
            continue
        assert environ == before
        for name in SEARCH_PATHS:
            entries = found.get(name, "x").split(os.pathsep)
            assert "" not in entries, "it would mean the working directory"
        assert split_path(found["AMENT_PREFIX_PATH"])[0] == target.install / packages()[0].name
        assert process_environment(target, found, packages(), warns=False) == found
        said = capsys.readouterr()
        assert not said.out
        assert all(line.isprintable() for line in said.err.splitlines()), before
        real_ros2(environ.get("PATH", "")), find_packages(split_path(found["AMENT_PREFIX_PATH"]))
        for candidate in candidates({**environ, "PATH": environ["PATH"].replace("/usr/bin", "")}):
            assert candidate


def test_a_shell_gets_the_very_values(tmp_path):
    """`source scripts/env.sh` evaluates what is printed: a value must never be run."""
    for rng in dice(15):
        values = {f"FBQL_FUZZ_{number}": odd_variable(rng) for number in range(8)}
        values["FBQL_FUZZ_X"] = rng.choice(
            (f"$(touch {tmp_path}/run)", f"`touch {tmp_path}/run`", "';exit 1;'", '"', "\\\n")
        )
        text = exports({"PATH": "/usr/bin:/bin"}, {"PATH": "/usr/bin:/bin", **values})
        done = subprocess.run(
            ["bash", "-c", 'eval "$1"; env -0', "bash", os.fsencode(text)], env={"PATH": "/usr/bin:/bin"}, capture_output=True,
            timeout=PATIENCE_S, check=False,
        )  # fmt: skip
        pairs = (each.partition(b"=") for each in done.stdout.split(b"\0"))
        shown = {os.fsdecode(name): os.fsdecode(value) for name, _, value in pairs}
        assert done.returncode == 0, done.stderr
        assert {name: shown.get(name) for name in values} == values
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize("words", [["tree.py", "check"], ["ros2", "pkg", "prefix", "fbql_sim"]])
def test_a_command_starts_or_says_what_is_wrong(words):
    """In processes, with the variables that a user or another program may set."""
    tree = ROOT / "ros2_ws/src/fbql_behaviors/fbql_behaviors/trees/approaching.json"
    usual = {name: value for name, value in os.environ.items() if name in ("PATH", "HOME", "LANG")}
    names = (
        *("HOME", "TERM", "COLUMNS", "LINES", "LANG", "LC_ALL", "TMPDIR", "ROS_DOMAIN_ID", "ROS_LOG_DIR", "ROS_HOME", "NO_COLOR"),
        *("RMW_IMPLEMENTATION", "ROS_DISCOVERY_SERVER", "ROS_STATIC_PEERS", "ROS_LOCALHOST_ONLY", "FASTRTPS_DEFAULT_PROFILES_FILE"),
        *("ROS_AUTOMATIC_DISCOVERY_RANGE", "ROS_SECURITY_ENABLE", "RCUTILS_LOGGING_USE_STDOUT", "RCUTILS_COLORIZED_OUTPUT"),
        *("FBQL_CHECKOUT", "PYTHONPATH", "AMENT_PREFIX_PATH", "COLCON_PREFIX_PATH", "ROS_DISTRO", "MPLBACKEND", "TZ", "XDG_CACHE_HOME"),
        *("RCUTILS_CONSOLE_OUTPUT_FORMAT", "LD_LIBRARY_PATH", "PYENV_ROOT", "OMP_NUM_THREADS", "SHELL", "VIRTUAL_ENV"),
    )  # fmt: skip
    for rng in dice(3):
        odd = {rng.choice(names): odd_variable(rng) for _ in range(rng.randrange(1, 4))}
        command = [
            "python3",
            str(ROOT / "scripts" / words[0]),
            *words[1:],
            *([str(tree)] if words[0] == "tree.py" else []),
        ]
        done = subprocess.run(command, env={**usual, **odd}, capture_output=True, timeout=100, check=False)
        said = done.stderr.decode(errors="surrogateescape").splitlines()
        assert done.returncode in (0, 1, 2), (odd, said)
        assert not any("Traceback" in line for line in said), (odd, said)
        assert (done.returncode == 0) == bool(done.stdout), (odd, said)
        assert done.returncode == 0 or said, odd
