"""Demonstrations are recorded, merged and made into a tree where ROS cannot be imported."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

PROGRAM = """
import importlib.abc
import sys

class Blocked(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in ("rclpy", "rosidl_parser", "ament_index_python", "builtin_interfaces", "std_msgs", "fbql_msgs"):
            raise ImportError(f"{name} is blocked")

sys.meta_path.insert(0, Blocked())
from fbql.cli.app import run

demonstrate = ["wall_avoiding", "--demonstrations", "2", "--steps", "20", "--out", "demos"]
assert run("demonstrate", demonstrate) == 0
assert run("demonstrate", ["--merge", "demos", "demos", "--out", "merged"]) == 0
assert run("induce", ["wall_avoiding", "--demos", "merged", "--every", "1", "--out", "tree.json"]) == 0
"""


def test_demonstrations_are_recorded_merged_and_induced_without_ros(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM], cwd=tmp_path, capture_output=True, text=True, timeout=120, check=False
    )
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "merged" / "merged_0.mcap").exists()
    assert (tmp_path / "tree.json").exists()
