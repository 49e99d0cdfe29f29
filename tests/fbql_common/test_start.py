"""Every executable of a node, started directly: an error in the environment is one line and exit code 2."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from importlib.metadata import entry_points
from pathlib import Path

import pytest
from node_process import NodeProcess

PACKAGES = ("fbql_sim", "fbql_behaviors", "fbql_fusion")
EXECUTABLES = sorted(
    (each.module.partition(".")[0], each.name)
    for each in entry_points(group="console_scripts")
    if each.module.startswith(PACKAGES)
)
UNFINDABLE = "peer..invalid"
"""A host's name that no name server needs to be asked about."""

StartNode = Callable[..., NodeProcess]


def only_line(process: NodeProcess) -> str:
    assert process.exit_code() == 2, process.printed()
    (line,) = process.printed().splitlines()
    assert "Traceback" not in line and "\x1b" not in line
    return line


def test_every_package_of_nodes_has_an_executable_here() -> None:
    assert {package for package, _ in EXECUTABLES} == set(PACKAGES)


@pytest.mark.parametrize(("package", "name"), EXECUTABLES)
def test_a_middleware_that_is_not_installed_is_one_line(start_node: StartNode, package: str, name: str) -> None:
    line = only_line(start_node(package, name, RMW_IMPLEMENTATION="rmw_nothing\x1b_cpp"))
    assert line == (
        r"RMW_IMPLEMENTATION='rmw_nothing\x1b_cpp' is not installed (installed: rmw_fastrtps_cpp); "
        "unset it, or install that middleware"
    )


@pytest.mark.parametrize(("package", "name"), EXECUTABLES)
def test_a_peer_that_can_not_be_found_is_one_line(start_node: StartNode, package: str, name: str) -> None:
    peers = {"ROS_STATIC_PEERS": f"127.0.0.1;{UNFINDABLE}", "ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"}
    line = only_line(start_node(package, name, **peers))
    assert line.startswith(f"ROS_STATIC_PEERS: '{UNFINDABLE}' can't be found (")
    assert line.endswith("correct it, or unset ROS_STATIC_PEERS")


def test_an_invalid_discovery_server_is_one_line(start_node: StartNode) -> None:
    server = {"ROS_DISCOVERY_SERVER": "not-a-server:x", "ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"}
    line = only_line(start_node("fbql_sim", "simulator", **server))
    assert line.startswith("ROS_DISCOVERY_SERVER: 'not-a-server:x' can't be found (not HOST or HOST:PORT)")


def test_an_interrupt_while_a_program_is_imported_prints_no_traceback(tmp_path: Path) -> None:
    (tmp_path / "slow.py").write_text("import os, signal\nos.kill(os.getpid(), signal.SIGINT)\n")
    code = "import sys; from fbql_common.start import start; sys.exit(start('slow', 'main'))"
    said = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (said.returncode, said.stdout, said.stderr) == (130, "", "")


HELP = "import sys; from fbql_common.start import start; sys.argv = ['x', '--help']; sys.exit(start('told', 'main'))"


@pytest.fixture
def told(tmp_path: Path) -> Path:
    """A directory with a module whose help has a character that ASCII lacks."""
    (tmp_path / "told.py").write_text('"""It drives, m²."""\nPARAMETERS = ()\n', encoding="utf-8")
    return tmp_path


def test_help_whose_reader_left_is_no_error(told: Path) -> None:
    read, write = os.pipe()
    os.close(read)
    said = subprocess.run([sys.executable, "-c", HELP], cwd=told, stdout=write, stderr=subprocess.PIPE, check=False)
    os.close(write)
    assert (said.returncode, said.stderr) == (0, b"")


def test_help_is_printed_in_ascii_too(told: Path) -> None:
    ascii_ = {**os.environ, "PYTHONIOENCODING": "ascii"}
    said = subprocess.run([sys.executable, "-c", HELP], cwd=told, env=ascii_, capture_output=True, check=False)
    assert (said.returncode, said.stderr) == (0, b"")
    assert b"It drives, m\\xb2." in said.stdout


def test_help_that_does_not_fit_on_the_disk_is_one_line(told: Path) -> None:
    with Path("/dev/full").open("w") as full:
        said = subprocess.run(
            [sys.executable, "-c", HELP], cwd=told, stdout=full, stderr=subprocess.PIPE, text=True, check=False
        )
    assert said.returncode == 1
    assert (
        said.stderr == "stdout: cannot be written (No space left on device); make room there, or choose another place\n"
    )
