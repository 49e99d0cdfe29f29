"""The variables of our processes: the wheels, a sourced system ROS, and an interactive shell."""

from __future__ import annotations

import os
import re
from pathlib import Path

import pytest
from environment.__main__ import exports
from environment.interpreter import candidates
from environment.ros2 import MARKERS, find_executables, find_packages, real_ros2
from environment.set_up import writable_cache
from environment.target import Target, target_for
from environment.variables import BOOTSTRAPPED, build_environment, process_environment, tool_environment
from places import ROOT
from setup_target import made_target, packages


@pytest.fixture
def made(tmp_path: Path) -> Target:
    """A checkout whose environment looks made."""
    return made_target(tmp_path / "checkout")


def entries(environ: dict[str, str], name: str) -> list[str]:
    """The entries of a search path variable."""
    return environ[name].split(os.pathsep)


def test_the_variables_lead_to_the_environment_and_every_package(made: Target) -> None:
    libraries = [made.site_packages / name for name in ("ros_a.libs", "ros_b.libs")]
    for directory in libraries:
        directory.mkdir(parents=True)
    environ = process_environment(made, {"PATH": "/usr/bin", "PYTHONPATH": "/mine"}, packages())
    prefixes = [str(made.install / "messages"), str(made.install / "node"), str(made.venv)]
    python_path = [f"{made.install}/messages/lib/python3.12/site-packages", f"{made.build}/node"]
    assert entries(environ, "PATH") == [f"{made.venv}/bin", "/usr/bin"]
    assert entries(environ, "AMENT_PREFIX_PATH") == entries(environ, "CMAKE_PREFIX_PATH") == prefixes
    assert entries(environ, "PYTHONPATH") == [*python_path, str(made.site_packages), "/mine"]
    expected = [f"{made.install}/messages/lib", f"{made.venv}/lib", *map(str, libraries)]
    assert entries(environ, "LD_LIBRARY_PATH") == expected
    assert environ[BOOTSTRAPPED] == "1"


def test_packages_of_another_python_are_left_out_and_none_of_the_users_own_come_before_the_locked(
    made: Target, capsys: pytest.CaptureFixture[str]
) -> None:
    given = "/mine:/usr/lib/python3.10/site-packages:/opt/py/lib/python3.12/site-packages:/home/me/.local/lib/python3.9"
    environ = process_environment(made, {"PYTHONPATH": given}, [])
    assert entries(environ, "PYTHONPATH") == [
        str(made.site_packages), "/mine", "/opt/py/lib/python3.12/site-packages",
    ]  # fmt: skip
    assert capsys.readouterr().err.count("belongs to another Python: it is ignored") == 1


def test_no_variable_of_colcon_reaches_the_build(made: Target) -> None:
    given = {
        "COLCON_DEFAULTS_FILE": "/x.yaml",
        "COLCON_LOG_LEVEL": "9",
        "COLCON_EXTENSION_BLOCKLIST": "a",
        "HOME": "/h",
    }
    environ = build_environment(made, given)
    assert [name for name in environ if name.startswith("COLCON_")] == ["COLCON_HOME"]


def test_a_build_does_not_wait_for_other_programs_unless_the_user_says_so(made: Target) -> None:
    """make -l N starts nothing more while the load is above N."""
    assert re.fullmatch(r"-j[1-9]\d*", build_environment(made, {"HOME": "/h"})["MAKEFLAGS"])
    assert build_environment(made, {"HOME": "/h", "MAKEFLAGS": "-j1 -l2"})["MAKEFLAGS"] == "-j1 -l2"


def test_the_users_choices_stay_and_discovery_is_local_by_default(made: Target) -> None:
    mine = {"ROS_DOMAIN_ID": "7", "ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET", "ROS_LOG_DIR": "/logs"}
    assert mine.items() <= process_environment(made, mine, []).items()
    assert process_environment(made, {}, [])["ROS_AUTOMATIC_DISCOVERY_RANGE"] == "LOCALHOST"


def test_another_distro_is_taken_out_with_one_warning(made: Target, capsys: pytest.CaptureFixture[str]) -> None:
    sourced = {
        "ROS_DISTRO": "humble",
        "ROS_VERSION": "2",
        "AMENT_PREFIX_PATH": "/home/me/ws/install/robot:/opt/ros/humble",
        "COLCON_PREFIX_PATH": "/home/me/ws/install",
        "PYTHONPATH": "/home/me/ws/install/robot/lib/python3.10/site-packages:/mine",
        "LD_LIBRARY_PATH": "/opt/ros/humble/lib",
        "PATH": "/opt/ros/humble/bin:/usr/bin",
        "RMW_IMPLEMENTATION": "rmw_cyclonedds_cpp",
        "PYTHONHOME": "/usr",
    }
    environ = process_environment(made, sourced, [])
    assert not any("/opt/ros" in value or "/home/me" in value for value in environ.values())
    assert not {"ROS_DISTRO", "ROS_VERSION", "COLCON_PREFIX_PATH", "RMW_IMPLEMENTATION", "PYTHONHOME"} & set(environ)
    assert entries(environ, "PYTHONPATH") == [str(made.site_packages), "/mine"]
    said = capsys.readouterr()
    assert said.out == ""
    assert "ROS 2 humble is sourced" in said.err
    assert "rmw_cyclonedds_cpp is ignored" in said.err


def test_computing_the_variables_twice_changes_nothing_and_an_overlay_built_on_our_environment_stays(
    made: Target, capsys: pytest.CaptureFixture[str]
) -> None:
    ours = process_environment(made, {"PATH": "/usr/bin"}, packages())
    assert process_environment(made, ours, packages()) == ours
    ours["AMENT_PREFIX_PATH"] = "/home/me/ws/install/robot:" + ours["AMENT_PREFIX_PATH"]
    assert "/home/me/ws/install/robot" in entries(process_environment(made, ours, packages()), "AMENT_PREFIX_PATH")
    assert capsys.readouterr() == ("", "")


def test_other_tools_get_nothing_that_changes_what_they_import() -> None:
    environ = {"PYTHONPATH": "/x", "PYTHONHOME": "/y", BOOTSTRAPPED: "1", "VIRTUAL_ENV": "/z", "https_proxy": "p"}
    assert tool_environment(environ) == {"https_proxy": "p"}


def test_the_build_sees_no_installed_package_and_writes_bytecode(made: Target) -> None:
    environ = build_environment(made, {"PYTHONPATH": "/mine", "PYTHONDONTWRITEBYTECODE": "1"})
    assert entries(environ, "AMENT_PREFIX_PATH") == [str(made.venv)]
    assert not {"PYTHONPATH", "PYTHONDONTWRITEBYTECODE"} & set(environ)


@pytest.fixture
def jazzy(tmp_path: Path) -> dict[str, str]:
    """The variables of a shell with a sourced Jazzy, and an overlay on it."""
    prefix = tmp_path / "opt" / "jazzy"
    (prefix / "lib" / "python3.12" / "site-packages" / "rclpy").mkdir(parents=True)
    (tmp_path / "overlay").mkdir()
    return {"ROS_DISTRO": "jazzy", "AMENT_PREFIX_PATH": f"{tmp_path}/overlay:{prefix}", "PATH": "/usr/bin"}


def test_a_sourced_jazzy_is_used_with_an_environment_and_a_build_of_its_own(
    made: Target, jazzy: dict[str, str], tmp_path: Path
) -> None:
    system = target_for(made.root, jazzy)
    assert system.underlay == (tmp_path / "overlay", tmp_path / "opt" / "jazzy")
    assert {system.venv, system.build, system.install}.isdisjoint({made.venv, made.build, made.install})
    environ = process_environment(system, jazzy, packages())
    assert entries(environ, "AMENT_PREFIX_PATH") == [
        *(str(system.install / name) for name in ("messages", "node")),
        *map(str, system.underlay),
    ]
    assert entries(environ, "PYTHONPATH")[-1] == str(system.site_packages)
    assert BOOTSTRAPPED not in environ
    assert target_for(made.root, environ).underlay == system.underlay


@pytest.mark.parametrize("change", [{"ROS_DISTRO": "kilted"}, {"ROS_DISTRO": ""}, {"AMENT_PREFIX_PATH": "/nowhere"}])
def test_anything_less_than_a_jazzy_with_rclpy_means_the_wheels(
    made: Target, jazzy: dict[str, str], change: dict[str, str]
) -> None:
    assert target_for(made.root, {**jazzy, **change}).venv == made.venv


@pytest.mark.parametrize("name", ["x" * 300, "/x" * 3000, "9" * 5000], ids=["name", "path", "number"])
def test_a_place_whose_name_is_too_long_holds_nothing(made: Target, name: str) -> None:
    assert target_for(made.root, {"ROS_DISTRO": "jazzy", "AMENT_PREFIX_PATH": name}).venv == made.venv
    assert find_packages([Path(name)]) == {}
    assert name not in "".join(candidates({"PYENV_ROOT": name, "HOME": name}))
    assert not writable_cache({"HOME": name})
    assert not writable_cache({"HOME": "/", "XDG_CACHE_HOME": name})


def test_our_own_environment_is_no_system_jazzy(made: Target) -> None:
    (made.site_packages / "rclpy").mkdir(parents=True)
    environ = {**process_environment(made, {}, packages()), "ROS_DISTRO": "jazzy"}
    assert target_for(made.root, environ).venv == made.venv


def add_executable(prefix: Path, package: str, name: str) -> Path:
    marker = prefix / MARKERS / package
    marker.parent.mkdir(parents=True, exist_ok=True)
    marker.touch()
    path = prefix / "lib" / package / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("#!/bin/sh\n")
    path.chmod(0o755)
    return path


def test_the_first_prefix_that_holds_a_package_wins(tmp_path: Path) -> None:
    for prefix in ("overlay", "under"):
        add_executable(tmp_path / prefix, "both", "run")
    add_executable(tmp_path / "under", "one", "run")
    found = find_packages([tmp_path / "overlay", tmp_path / "missing", tmp_path / "under"])
    assert found == {"both": tmp_path / "overlay", "one": tmp_path / "under"}


def test_executables_are_the_executable_files_not_in_hidden_places(tmp_path: Path) -> None:
    paths = [add_executable(tmp_path, "p", name) for name in ("b", "a", "sub/c")]
    add_executable(tmp_path, "p", ".hidden/d")
    add_executable(tmp_path, "p", "data").chmod(0o644)
    assert find_executables({"p": tmp_path}, "p") == sorted(paths)


def test_our_own_ros2_is_no_real_one(tmp_path: Path) -> None:
    real = tmp_path / "ros2"
    real.write_text("#!/bin/sh\n")
    real.chmod(0o755)
    assert real_ros2(str(ROOT / "scripts")) is None
    assert real_ros2(f"{ROOT}/scripts{os.pathsep}{tmp_path}") == str(real)


def test_the_shell_gets_what_changed_and_the_scripts_only_without_a_real_ros2(tmp_path: Path) -> None:
    before = {"PATH": "/usr/bin", "KEPT": "x", "GONE": "y", BOOTSTRAPPED: "1"}
    after = {"PATH": "/venv/bin:/usr/bin", "KEPT": "x", "NEW": "it's; $HOME", BOOTSTRAPPED: "1"}
    lines = exports(before, after).splitlines()
    assert lines == [
        """export NEW='it'"'"'s; $HOME'""",
        f"export PATH=/venv/bin:/usr/bin:{ROOT}/scripts",
        "unset GONE",
        f"unset {BOOTSTRAPPED}",
    ]
    add_executable(tmp_path, "ros2", "ros2")
    after["PATH"] = f"{tmp_path}/lib/ros2"
    assert f"{ROOT}/scripts" not in exports(before, after)
