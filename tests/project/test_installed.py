"""Installed with pip, in an empty environment without ROS; and `ros2 run` in the built workspace."""

from __future__ import annotations

import json
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest
from places import ROOT
from setup_checkout import REAL_PYTHON, fresh_environment, run, start

RECORDED = ROOT / "tests" / "data" / "recorded_match"
TRAIN = ("train", "--controller", "subsumption", "--episodes", "3", "--seed", "31", "--json")

Fbql = Callable[..., subprocess.CompletedProcess[str]]


@pytest.fixture(scope="module")
def sources(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What pip needs of the checkout, in a place of its own: it leaves a build directory there."""
    place = tmp_path_factory.mktemp("sources")
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, place / name)
    ignored = shutil.ignore_patterns("__pycache__", "*.egg-info", "build")
    shutil.copytree(ROOT / "ros2_ws" / "src", place / "ros2_ws" / "src", ignore=ignored)
    return place


@pytest.fixture(scope="module")
def environment(sources: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An environment in which `pip install .` was all that was done."""
    place = tmp_path_factory.mktemp("environment")
    assert run([str(REAL_PYTHON), "-m", "venv", str(place)], fresh_environment()).returncode == 0
    install(place, str(sources))
    return place


def install(environment: Path, *what: str) -> None:
    """Install with uv where there is one, which is quicker, else with pip."""
    uv = shutil.which("uv")
    python = str(environment / "bin" / "python")
    command = [uv, "pip", "install", "-q", "--python", python] if uv else [python, "-m", "pip", "install", "-q"]
    done = run([*command, *what], fresh_environment(PIP_NO_COMPILE=""))
    assert done.returncode == 0, done.stderr


@pytest.fixture
def fbql(environment: Path, tmp_path: Path) -> Fbql:
    """Runs `fbql ARGUMENTS` of the environment in an empty directory."""

    def call(*arguments: str, program: str = "fbql") -> subprocess.CompletedProcess[str]:
        words = [str(environment / "bin" / program), *arguments]
        environ = fresh_environment()
        environ.pop("FBQL_CHECKOUT", None)
        return subprocess.run(
            words, env=environ, cwd=tmp_path, capture_output=True, text=True, timeout=120, check=False
        )

    return call


def digest_of(said: subprocess.CompletedProcess[str]) -> str:
    assert said.returncode == 0, said.stderr
    return json.loads(said.stdout)["digest"]


def test_the_library_imports_and_ros_is_not_there(fbql: Fbql) -> None:
    assert fbql("-c", "import fbql, fbql_studies", program="python").returncode == 0
    assert "No module named 'rclpy'" in fbql("-c", "import rclpy", program="python").stderr


def test_a_match_has_the_same_digest_installed_by_its_door_and_by_ros2_run(fbql: Fbql) -> None:
    digest = digest_of(fbql(*TRAIN))
    assert digest_of(start(ROOT, "train.py", *TRAIN[1:])) == digest
    assert digest_of(start(ROOT, "ros2", "run", "fbql", *TRAIN)) == digest


@pytest.mark.parametrize(
    ("words", "shown"),
    [
        ("--help", "bringup"),
        ("--version", "0."),
        ("replay RUN --verify", "identical"),
        ("report RUN --out page", "report page"),
        ("recover RUN", "nothing is lost"),
        ("compare RUN AGAIN", "goals"),
        ("tree explain TREE", "leaves"),
        ("induce approaching --trials 2 --json", "leaves"),
        ("experiment paper --help", "--seeds"),
        ("lesson --help", "--check"),
        ("bringup --help", "--watch"),
    ],
)
def test_a_command_that_needs_no_ros_works_without_it(fbql: Fbql, tmp_path: Path, words: str, shown: str) -> None:
    for name in ("RUN", "AGAIN"):
        shutil.copytree(RECORDED, tmp_path / name)
    tree = ROOT / "ros2_ws/src/fbql_behaviors/fbql_behaviors/trees/approaching.json"
    said = fbql(*(str(tree) if word == "TREE" else word for word in words.split()))
    assert said.returncode == 0, said.stderr
    assert shown in said.stdout


def test_demonstrations_are_recorded_and_learned_from_without_ros(fbql: Fbql, tmp_path: Path) -> None:
    """What is recorded has the definitions of its messages from the installed package."""
    demonstrated = fbql(*["demonstrate", "approaching", "--demonstrations", "1", "--out", "DEMOS", "--json"])
    assert demonstrated.returncode == 0, demonstrated.stderr
    made = json.loads(demonstrated.stdout)
    assert (made["demonstrations"], made["path"]) == (1, "DEMOS")
    induced = fbql(*["induce", "approaching", "--demos", "DEMOS", "--trials", "2", "--out", "tree.json", "--json"])
    assert induced.returncode == 0, induced.stderr
    assert json.loads(induced.stdout)["leaves"] >= 2
    assert (tmp_path / "tree.json").is_file()


@pytest.mark.parametrize(
    ("words", "needed"),
    [
        ("bringup", "this needs ROS 2 Jazzy"),
        ("replay RUN", "this needs ROS 2 Jazzy"),
        ("report RUN --figures", "pip install '.[studies]'"),
        ("lesson 1", "docs/course of a clone"),
    ],
)
def test_a_command_says_in_one_line_what_is_not_installed(fbql: Fbql, tmp_path: Path, words: str, needed: str) -> None:
    shutil.copytree(RECORDED, tmp_path / "RUN")
    said = fbql(*words.split())
    assert (said.returncode, said.stdout, said.stderr.count("\n")) == (2, "", 1), said.stderr
    assert needed in said.stderr


def test_an_editable_installation_takes_up_an_edit(environment: Path, sources: Path, fbql: Fbql) -> None:
    install(environment, "--no-deps", "--editable", str(sources))
    place = sources / "ros2_ws/src/fbql/fbql/cli/exit_codes.py"
    place.write_text(place.read_text().replace("DONE = 0", "DONE = 99"))
    assert fbql("--help").returncode == 99


def test_ros2_run_finds_the_commands_in_the_built_workspace() -> None:
    said = start(ROOT, "ros2", "run", "fbql", "bringup", "--help")
    assert said.returncode == 0, said.stderr
    assert "usage: bringup" in said.stdout
    listed = start(ROOT, "ros2", "pkg", "executables", "fbql").stdout.split()
    assert {"bringup", "replay", "train"} <= set(listed)


def test_a_clone_that_is_told_to_write_crlf_has_the_same_bytes(tmp_path: Path) -> None:
    clone = ["git", "clone", "-q", "-c", "core.autocrlf=true", str(ROOT), str(tmp_path / "clone")]
    if run(clone, fresh_environment()).returncode:
        pytest.skip("this is no clone of git's")
    for name in ("env.sh", "ros2", "train.py"):
        assert b"\r" not in (tmp_path / "clone" / "scripts" / name).read_bytes()
