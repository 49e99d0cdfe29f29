"""Who may import whom: scripts -> {fbql_sim, fbql_behaviors, fbql_fusion, fbql_analysis} -> fbql_common -> fbql_msgs;
a core without ROS, and fbql_analysis wholly without it."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

ROOT = Path(__file__).resolve().parents[2]
SOURCE = ROOT / "ros2_ws" / "src"
PACKAGES = ("fbql_common", "fbql_sim", "fbql_behaviors", "fbql_fusion", "fbql_analysis")
MAY_IMPORT = {
    "fbql_common": {"fbql_msgs"},
    "fbql_sim": {"fbql_common", "fbql_msgs"},
    "fbql_behaviors": {"fbql_common", "fbql_msgs"},
    "fbql_fusion": {"fbql_common", "fbql_msgs"},
    "fbql_analysis": {"fbql_common"},
}
"""What of our own a package may import beside itself."""
PHYSICS = "fbql_sim.core.physics"
NO_CORE = {
    "datetime",
    "glob",
    "os",
    "pathlib",
    "random",
    "shutil",
    "socket",
    "subprocess",
    "tempfile",
    "threading",
    "time",
}
"""Of the standard library: clocks, paths, processes, and the global random generator."""
ROS = (
    "ament_index_python",
    "builtin_interfaces",
    "diagnostic_msgs",
    "fbql_msgs",
    "geometry_msgs",
    "rcl_interfaces",
    "rclpy",
    "rosgraph_msgs",
    "rosidl_parser",
    "rosidl_pycommon",
    "rpyutils",
    "std_msgs",
    "std_srvs",
    "visualization_msgs",
)
"""What is blocked while the cores are loaded."""

LOAD_WITHOUT_ROS = """
import importlib
import importlib.abc
import sys

class Blocked(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in blocked:
            raise ImportError(f"{name} is blocked")

blocked = set(sys.argv[1].split(","))
early = blocked & set(sys.modules)
assert not early, f"loaded before the test could block them: {early}"
sys.meta_path.insert(0, Blocked())
try:
    importlib.import_module("rclpy")
except ImportError as error:
    assert "is blocked" in str(error), error
else:
    raise AssertionError("rclpy could be imported: the block does not hold")
for name in sys.argv[2:]:
    importlib.import_module(name)
    print(name)
"""


COMPUTED = "<a computed name>"


class Import(NamedTuple):
    """One import of a module: by a statement, or by a call of import_module."""

    module: str
    line: int

    @property
    def root(self) -> str:
        """The top-level package."""
        return self.module.partition(".")[0]


def modules(package: str) -> dict[str, Path]:
    """Every module of a package, by its dotted name."""
    top = SOURCE / package
    found: dict[str, Path] = {}
    for path in sorted((top / package).rglob("*.py")):
        parts = path.relative_to(top).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


def core_modules(package: str) -> dict[str, Path]:
    """The modules in a package's core/."""
    return {name: path for name, path in modules(package).items() if name.split(".")[1:2] == ["core"]}


def imports(name: str, path: Path) -> Iterator[Import]:
    """Everything that a module imports, at its top or anywhere inside; relative names made absolute."""
    package = name if path.stem == "__init__" else name.rpartition(".")[0]
    for node in ast.walk(ast.parse(path.read_text(), str(path))):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield Import(alias.name, node.lineno)
        elif isinstance(node, ast.ImportFrom):
            above = package.split(".")[: len(package.split(".")) - node.level + 1] if node.level else []
            base = ".".join([*above, *([node.module] if node.module else [])])
            # `from package import x` may import the module package.x: both names are looked at.
            yield Import(base, node.lineno)
            for alias in node.names:
                yield Import(f"{base}.{alias.name}", node.lineno)
        elif isinstance(node, ast.Call) and getattr(node.func, "id", getattr(node.func, "attr", "")) in (
            "import_module",
            "__import__",
        ):
            name_given = node.args[0] if node.args else None
            yield Import(str(name_given.value) if isinstance(name_given, ast.Constant) else COMPUTED, node.lineno)


def breaches(paths: dict[str, Path], is_allowed: Callable[[str, Import], bool]) -> list[str]:
    """The imports of modules that are not allowed, as file:line texts."""
    assert paths
    return [
        f"{path.relative_to(ROOT)}:{each.line} imports {each.module}"
        for name, path in paths.items()
        for each in imports(name, path)
        if not is_allowed(name, each)
    ]


@pytest.mark.parametrize("package", PACKAGES)
def test_core_loads_where_ros_cannot_be_imported(package: str) -> None:
    names = list(core_modules(package))
    assert len(names) > 1, "the package has a core/ with modules"
    assert_loads_without_ros(names)


def test_recordings_are_read_where_ros_cannot_be_imported() -> None:
    assert_loads_without_ros(list(modules("fbql_analysis")))


def assert_loads_without_ros(names: list[str]) -> None:
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(str(SOURCE / each) for each in PACKAGES)}
    done = subprocess.run(
        [sys.executable, "-c", LOAD_WITHOUT_ROS, ",".join(ROS), *names],
        env=environment,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == names


@pytest.mark.parametrize("package", PACKAGES)
def test_core_imports_the_standard_library_numpy_and_core_alone(package: str) -> None:
    def is_allowed(name: str, each: Import) -> bool:
        is_core = each.root in {package, "fbql_common"} and each.module.split(".")[1:2] == ["core"]
        is_standard = each.root in sys.stdlib_module_names and each.root not in NO_CORE
        return is_core or is_standard or each.root == "numpy" or (each.root == "pymunk" and name == PHYSICS)

    found = breaches(core_modules(package), is_allowed)
    assert not found, "\n".join(found)


@pytest.mark.parametrize("package", PACKAGES)
def test_packages_import_fbql_common_and_never_each_other(package: str) -> None:
    ours = {"fbql_msgs", "launcher", "environment", "measure", "tests", *PACKAGES}
    allowed = {package, *MAY_IMPORT[package]}
    found = breaches(modules(package), lambda _, each: each.root not in ours or each.root in allowed)
    assert not found, "\n".join(found)


def test_the_set_up_runs_on_the_standard_library_alone() -> None:
    scripts = ROOT / "scripts"
    names = {path: ".".join(path.relative_to(scripts).with_suffix("").parts) for path in scripts.glob("environment/*")}
    paths = {name.removesuffix(".__init__"): path for path, name in names.items() if path.suffix == ".py"}

    def is_allowed(name: str, each: Import) -> bool:
        # enter.py reaches the launcher by a computed name, once the environment is there.
        is_entry = each.module == COMPUTED and name == "environment.enter"
        return is_entry or each.root in {"environment", *sys.stdlib_module_names}

    found = breaches(paths, is_allowed)
    assert not found, "\n".join(found)


def test_nothing_unpickles() -> None:
    unpicklers = {"cloudpickle", "dill", "joblib", "marshal", "pickle", "shelve"}
    folders = ("ros2_ws/src", "scripts", "benchmarks")
    paths = {str(path): path for folder in folders for path in (ROOT / folder).rglob("*.py")}
    found = breaches(paths, lambda _, each: each.root not in unpicklers)
    for path in paths.values():
        found += [
            f"{path.relative_to(ROOT)}:{node.value.lineno} allows pickle"
            for node in ast.walk(ast.parse(path.read_text()))
            if isinstance(node, ast.keyword) and node.arg == "allow_pickle" and ast.unparse(node.value) != "False"
        ]
    assert not found, "\n".join(found)


@pytest.mark.parametrize("package", PACKAGES)
def test_a_package_declares_the_ros_packages_that_it_imports(package: str) -> None:
    manifest = (SOURCE / package / "package.xml").read_text()
    ros = {*ROS, *PACKAGES} - {package}
    found = breaches(modules(package), lambda _, each: each.root not in ros or f"depend>{each.root}</" in manifest)
    assert not found, "\n".join(found)
