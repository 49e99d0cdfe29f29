"""Launch files, where ROS launch is: the wheels bring none, so that elsewhere only their place is tested."""

from __future__ import annotations

import ast
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from ament_index_python.packages import get_package_share_directory
from commands import train
from places import ROOT

FILES = sorted((ROOT / "ros2_ws" / "src").glob("*/launch/*.launch.py"))
MATCH = "match.launch.py"


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.name)
def test_a_launch_file_is_installed_where_ros2_launch_looks(file: Path) -> None:
    installed = Path(get_package_share_directory(file.parts[-3])) / "launch" / file.name
    assert installed.read_bytes() == file.read_bytes()
    functions = {node.name for node in ast.parse(file.read_text()).body if isinstance(node, ast.FunctionDef)}
    assert "generate_launch_description" in functions


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.name)
def test_a_launch_file_gives_every_parameter_a_type(file: Path) -> None:
    keywords = [node for node in ast.walk(ast.parse(file.read_text())) if isinstance(node, ast.keyword)]
    given = [node.value for node in keywords if node.arg == "parameters"]
    values = [each for every in given for node in ast.walk(every) if isinstance(node, ast.Dict) for each in node.values]
    # Launch reads the text of any other substitution as YAML: a behavior with the name on would be called true.
    assert {ast.unparse(each).partition("(")[0] for each in values} <= {"ParameterValue"}


def test_a_launched_match_has_the_digest_of_train(tmp_path: Path, domain: dict[str, str]) -> None:
    pytest.importorskip("launch.actions", reason="ROS launch is not among the wheels")
    code = """
import sys
from launch import LaunchDescription, LaunchService
from launch.actions import IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
service = LaunchService()
source = PythonLaunchDescriptionSource(sys.argv[1])
arguments = [tuple(word.split(":=")) for word in sys.argv[2:]]
service.include_launch_description(LaunchDescription([IncludeLaunchDescription(source, launch_arguments=arguments)]))
sys.exit(service.run())
"""
    (file,) = (each for each in FILES if each.name == MATCH)
    options = {"goals": "2", "seed": "1"}
    words = [f"{name}:={value}" for name, value in {**options, "out": str(tmp_path / "launched")}.items()]
    subprocess.run(
        [sys.executable, "-c", code, str(file), *words], env={**os.environ, **domain}, timeout=120, check=True
    )
    assert train(["--goals", "2", "--seed", "1", "--out", str(tmp_path / "trained")]) == 0
    found = [json.loads((tmp_path / name / "summary.json").read_text())["digest"] for name in ("launched", "trained")]
    assert found[0] == found[1]
