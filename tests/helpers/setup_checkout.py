"""A small checkout with the real set-up in it: the scripts as they are, a lock cut down to colcon and pytest, and one
package. It takes seconds to set up where the whole one takes a minute, by the same code.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest
from places import ROOT

REAL_PYTHON = Path(sys.base_prefix) / "bin" / "python3.12"
START_TIMEOUT_S = 600

KEPT_SCRIPTS = ("environment", "ros2", "env.sh", "test.py")
KEPT = re.compile(
    r"(argcomplete|catkin-pkg|colcon-.*|distlib|docutils|empy|packaging|pyparsing|python-dateutil|pyyaml|setuptools|six)=="
)
KEPT_FOR_TESTS = re.compile(r"(iniconfig|pluggy|pygments|pytest)==")

PACKAGE_XML = """<?xml version="1.0"?>
<package format="3">
  <name>{name}</name>
  <version>0.1.0</version>
  <description>Says what it is told.</description>
  <maintainer email="nobody@fbql.invalid">nobody</maintainer>
  <license>Apache-2.0</license>
  <export><build_type>ament_python</build_type></export>
</package>
"""
SETUP_PY = """from setuptools import find_packages, setup
setup(
    name="{name}",
    version="0.1.0",
    packages=find_packages(),
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/{name}"]),
        ("share/{name}", ["package.xml"]),
    ],
    entry_points={{"console_scripts": ["speak = {name}.speak:main"]}},
)
"""
SETUP_CFG = "[develop]\nscript_dir=$base/lib/{name}\n[install]\ninstall_scripts=$base/lib/{name}\n"
SPEAK = """import sys
def main():
    print("speaks", *sys.argv[1:])
    return 7
"""


def make_checkout(place: Path) -> Path:
    """A fresh checkout at `place`, with nothing set up."""
    for name in KEPT_SCRIPTS:
        source, copy = ROOT / "scripts" / name, place / "scripts" / name
        copy.parent.mkdir(parents=True, exist_ok=True)
        if source.is_dir():
            shutil.copytree(source, copy, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy(source, copy)
    shutil.copytree(ROOT / "cmake", place / "cmake")
    for name in ("pyproject.toml", "ros2_ws/colcon.meta"):
        (place / name).parent.mkdir(exist_ok=True)
        shutil.copy(ROOT / name, place / name)
    (place / "requirements").mkdir()
    for name in ("ros", "run", "test", "study"):
        entries = re.split(r"^(?=\S)", (ROOT / "requirements" / f"{name}.txt").read_text(), flags=re.MULTILINE)
        kept = KEPT_FOR_TESTS if name == "test" else KEPT
        (place / "requirements" / f"{name}.txt").write_text("".join(filter(kept.match, entries)))
    assert (place / "requirements/ros.txt").read_text().count("==") > 20, "the lock is not what this expects"
    write_package(place / "ros2_ws" / "src" / "speaker")
    return place


def write_package(place: Path) -> None:
    """A package named as the directory `place`, with one executable."""
    name = place.name
    files = {
        "package.xml": PACKAGE_XML.format(name=name),
        "setup.py": SETUP_PY.format(name=name),
        "setup.cfg": SETUP_CFG.format(name=name),
        f"resource/{name}": "",
        f"{name}/__init__.py": "",
        f"{name}/speak.py": SPEAK,
    }
    for path, text in files.items():
        (place / path).parent.mkdir(parents=True, exist_ok=True)
        (place / path).write_text(text)


def fresh_environment(**changes: str) -> dict[str, str]:
    """The variables of a shell in which no environment is active, with `changes`."""
    names = ("AMENT_PREFIX_PATH", "CMAKE_PREFIX_PATH", "PYTHONPATH", "LD_LIBRARY_PATH", "VIRTUAL_ENV", "ROS_DISTRO")
    dropped = {*names, "_ROS_WHEELS_BOOTSTRAP_COMPLETE", "ROS_PYTHON_CHECK_FIELDS"}
    environ = {name: value for name, value in os.environ.items() if name not in dropped}
    entries = environ["PATH"].split(os.pathsep)
    environ["PATH"] = os.pathsep.join(entry for entry in entries if not Path(entry).is_relative_to(sys.prefix))
    environ["PIP_NO_COMPILE"] = "1"  # for what is thrown away at once, bytecode is not worth its time
    return {**environ, **changes}


def command(checkout: Path, script: str, *arguments: str) -> list[str]:
    """The command line that starts a script of `checkout` as a user would."""
    return [str(REAL_PYTHON), str(checkout / "scripts" / script), *arguments]


def start(checkout: Path, script: str, *arguments: str, **changes: str) -> subprocess.CompletedProcess[str]:
    """Start a script of `checkout` in a fresh environment and wait for its end."""
    return run(command(checkout, script, *arguments), fresh_environment(**changes))


def in_mount_namespace(script: str) -> subprocess.CompletedProcess[str]:
    """Run a shell script that may mount what nobody else sees; skips the test where that is not allowed."""
    namespace = ["unshare", "--user", "--map-root-user", "--mount"]
    if shutil.which("unshare") is None or run([*namespace, "true"], fresh_environment()).returncode:
        pytest.skip("needs user namespaces, to mount file systems")
    return run([*namespace, "sh", "-c", script], fresh_environment())


def run(arguments: Sequence[str], environ: dict[str, str]) -> subprocess.CompletedProcess[str]:
    """Run a program without stdin, and return what it said."""
    return subprocess.run(
        arguments,
        env=environ,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=START_TIMEOUT_S,
        check=False,
    )
