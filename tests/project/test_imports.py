"""Who may import whom: fbql_studies -> fbql -> {fbql_sim, fbql_behaviors, fbql_fusion} -> fbql_recording -> fbql_common ->
fbql_msgs. No circle between files, none between folders; a core without ROS, and fbql_recording wholly without it."""

from __future__ import annotations

import ast
import os
import re
import subprocess
import sys
import tomllib
from collections.abc import Callable, Iterable
from functools import cache
from itertools import chain
from pathlib import Path
from typing import NamedTuple

import pytest
import yaml
from patience import PATIENCE_S
from places import ROOT

SOURCE = ROOT / "ros2_ws" / "src"
BELOW = {
    "fbql_common": {"fbql_msgs"},
    "fbql_recording": {"fbql_common"},
    "fbql_sim": {"fbql_recording", "fbql_common", "fbql_msgs"},
    "fbql_behaviors": {"fbql_recording", "fbql_common", "fbql_msgs"},
    "fbql_fusion": {"fbql_recording", "fbql_common", "fbql_msgs"},
}
PACKAGES = (*BELOW, "fbql", "fbql_studies")
CORES = tuple(BELOW)
"""Packages that have a core/."""
MAY_IMPORT = {
    **BELOW,
    "fbql": {*BELOW, "fbql_msgs"},
    "fbql_studies": {*BELOW, "fbql"},
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
    "domain_coordinator",
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


@cache
def nodes_of(path: Path) -> tuple[ast.AST, ...]:
    """All nodes of the syntax tree of a file."""
    return tuple(ast.walk(ast.parse(path.read_text(), str(path))))


@cache
def imports(name: str, path: Path) -> list[Import]:
    """Everything that a module imports, at its top or anywhere inside; relative names made absolute."""
    package = name if path.stem == "__init__" else name.rpartition(".")[0]
    result: list[Import] = []
    for node in nodes_of(path):
        if isinstance(node, ast.Import):
            result += [Import(alias.name, node.lineno) for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            above = package.split(".")[: len(package.split(".")) - node.level + 1] if node.level else []
            base = ".".join([*above, *([node.module] if node.module else [])])
            # `from package import x` may import the module package.x: both names count.
            result += [Import(base, node.lineno), *(Import(f"{base}.{x.name}", node.lineno) for x in node.names)]
        elif isinstance(node, ast.Call) and getattr(node.func, "id", getattr(node.func, "attr", "")) in (
            "import_module",
            "__import__",
        ):
            name_given = node.args[0] if node.args else None
            module = str(name_given.value) if isinstance(name_given, ast.Constant) else COMPUTED
            result.append(Import(module, node.lineno))
    return result


def breaches(paths: dict[str, Path], is_allowed: Callable[[str, Import], bool]) -> list[str]:
    """The imports of modules that are not allowed, as file:line texts."""
    assert paths
    return [
        f"{path.relative_to(ROOT)}:{each.line} imports {each.module}"
        for name, path in paths.items()
        for each in imports(name, path)
        if not is_allowed(name, each)
    ]


@pytest.mark.parametrize("package", CORES)
def test_core_loads_where_ros_cannot_be_imported(package: str) -> None:
    names = list(core_modules(package))
    assert len(names) > 1, "the package has a core/ with modules"
    assert_loads_without_ros(names)


def test_recordings_are_read_where_ros_cannot_be_imported() -> None:
    assert_loads_without_ros(list(modules("fbql_recording")))


def assert_loads_without_ros(names: list[str]) -> None:
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(str(SOURCE / each) for each in PACKAGES)}
    done = subprocess.run(
        [sys.executable, "-c", LOAD_WITHOUT_ROS, ",".join(ROS), *names],
        env=environment,
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == names


@pytest.mark.parametrize("package", CORES)
def test_core_imports_the_standard_library_numpy_and_core_alone(package: str) -> None:
    def is_allowed(name: str, each: Import) -> bool:
        is_core = each.root in {package, *BELOW[package]} and each.module.split(".")[1:2] == ["core"]
        is_standard = each.root in sys.stdlib_module_names and each.root not in NO_CORE
        return is_core or is_standard or each.root == "numpy" or (each.root == "pymunk" and name == PHYSICS)

    found = breaches(core_modules(package), is_allowed)
    assert not found, "\n".join(found)


@pytest.mark.parametrize("package", PACKAGES)
def test_a_package_imports_only_those_below_it(package: str) -> None:
    ours = {"fbql_msgs", "environment", "measure", "tests", *PACKAGES}
    allowed = {package, *MAY_IMPORT[package]}
    found = breaches(modules(package), lambda _, each: each.root not in ours or each.root in allowed)
    assert not found, "\n".join(found)


@pytest.mark.parametrize("package", PACKAGES)
def test_there_is_no_circle_between_files_or_folders(package: str) -> None:
    paths = modules(package)
    files = {
        name: {each.module for each in imports(name, path)} & paths.keys() - {name} for name, path in paths.items()
    }
    folders: dict[str, set[str]] = {}
    for name, targets in files.items():
        own = folder_of(name, paths)
        folders.setdefault(own, set()).update({folder_of(target, paths) for target in targets} - {own, package})
    # A package's own __init__ is reached by `import package.module` from everywhere; what it hands on stands above all.
    folders.pop(package, None)
    files.pop(package, None)
    for graph in (files, folders):
        assert not circle(graph), f"{package}: {' -> '.join(circle(graph))}"


def folder_of(name: str, paths: dict[str, Path]) -> str:
    """The dotted name of the folder that a module is in."""
    return name if paths[name].stem == "__init__" else name.rpartition(".")[0]


def circle(graph: dict[str, set[str]]) -> list[str]:
    """Names in a circle, each importing the next; none where there is no circle."""
    done: set[str] = set()

    def search(name: str, path: list[str]) -> list[str]:
        if name in path:
            return [*path[path.index(name) :], name]
        if name in done:
            return []
        for target in sorted(graph.get(name, ())):
            if found := search(target, [*path, name]):
                return found
        done.add(name)
        return []

    return next((found for name in sorted(graph) if (found := search(name, []))), [])


def test_the_set_up_runs_on_the_standard_library_alone() -> None:
    scripts = ROOT / "scripts"
    names = {path: ".".join(path.relative_to(scripts).with_suffix("").parts) for path in scripts.glob("environment/*")}
    paths = {name.removesuffix(".__init__"): path for path, name in names.items() if path.suffix == ".py"}

    def is_allowed(name: str, each: Import) -> bool:
        # enter.py reaches the command, once the environment is there.
        is_entry = each.module.startswith(("fbql.cli.app", COMPUTED)) and name == "environment.enter"
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
            for node in nodes_of(path)
            if isinstance(node, ast.keyword) and node.arg == "allow_pickle" and ast.unparse(node.value) != "False"
        ]
    assert not found, "\n".join(found)


NAMES = {
    "foxglove": "foxglove-sdk",
    "irsim": "ir-sim",
    "sklearn": "scikit-learn",
    "stable_baselines3": "stable-baselines3",
    "yaml": "PyYAML",
}
"""Import -> distribution, where they differ."""
KEYS = {"PyYAML": "python3-yaml", "mcap": "python3-mcap-pip", "pymunk": "python3-pymunk-pip"}
"""Distribution -> rosdep key, where it is not python3-NAME."""
IN_ROSDISTRO = {"python3-matplotlib", "python3-numpy", "python3-pytest", "python3-websockets", "python3-yaml"}
NOT_OURS = {"pystreed"}
"""Only used where the user has installed it: it depends on a package under the GPL."""


def setup_lists(package: str) -> tuple[set[str], set[str]]:
    """The distributions that a package's setup.py requires, and those of its extras, without versions."""
    tree = ast.parse((SOURCE / package / "setup.py").read_text())
    found = {
        node.arg: ast.literal_eval(node.value)
        for node in ast.walk(tree)
        if isinstance(node, ast.keyword) and node.arg in ("install_requires", "extras_require")
    }
    return without_versions(found["install_requires"]), without_versions(chain(*found["extras_require"].values()))


def without_versions(requirements: Iterable[str]) -> set[str]:
    """The names of requirements."""
    return {re.split(r"[<>=\[ ]", each)[0] for each in requirements}


@pytest.mark.parametrize("package", PACKAGES)
def test_a_package_declares_what_it_imports_in_its_manifest_and_its_setup(package: str) -> None:
    manifest = (SOURCE / package / "package.xml").read_text()
    required, optional = setup_lists(package)
    ros = {*ROS, *PACKAGES} - {package}

    def is_declared(_: str, each: Import) -> bool:
        if each.root in ros:
            return f"depend>{each.root}</" in manifest
        if each.root in {package, COMPUTED, *NOT_OURS, *sys.stdlib_module_names}:
            return True
        name = NAMES.get(each.root, each.root)
        return name in optional or (name in required and f"depend>{KEYS.get(name, f'python3-{name}')}</" in manifest)

    found = breaches(modules(package), is_declared)
    assert not found, "\n".join(found)


@pytest.mark.parametrize("package", PACKAGES)
def test_every_rosdep_key_of_a_manifest_is_known(package: str) -> None:
    keys = set(re.findall(r"depend>(python3-[^<]*)</", (SOURCE / package / "package.xml").read_text()))
    assert keys <= {*IN_ROSDISTRO, *yaml.safe_load((ROOT / "ros2_ws" / "rosdep.yaml").read_text())}


def test_the_root_declares_what_the_packages_declare() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = without_versions(chain(*project["optional-dependencies"].values()))
    for package in PACKAGES:
        required, optional = setup_lists(package)
        assert required - {"setuptools"} <= without_versions(project["dependencies"]), package
        assert optional <= extras, package


@pytest.mark.parametrize("package", (*PACKAGES, "fbql_msgs"))
def test_no_manifest_names_a_host_that_is_not_ours(package: str) -> None:
    manifest = (SOURCE / package / "package.xml").read_text()
    assert re.findall(r'email="[^"]*@([^"]*)"', manifest) == ["example.org"]
    assert "<url" not in manifest
