"""The environment variables of our processes, computed without sourcing anything."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from pathlib import Path

from .progress import say
from .target import DISTRO, Package, Target, is_inside, split_path

# Set by the wheels' start-up hook, which otherwise runs every Python a second time to set LD_LIBRARY_PATH.
BOOTSTRAPPED = "_ROS_WHEELS_BOOTSTRAP_COMPLETE"
SEARCH_PATHS = ("PATH", "PYTHONPATH", "LD_LIBRARY_PATH", "AMENT_PREFIX_PATH", "CMAKE_PREFIX_PATH", "PKG_CONFIG_PATH")
OF_A_DISTRO = ("ROS_DISTRO", "ROS_VERSION", "ROS_PYTHON_VERSION", "ROS_PACKAGE_PATH", "ROS_ROOT", "ROS_ETC_DIR")


def process_environment(
    target: Target, environ: Mapping[str, str], packages: list[Package], *, warns: bool = True
) -> dict[str, str]:
    """`environ`, changed so that the workspace's `packages` and their dependencies are found.

    The user's choices (domain, discovery range, log directory, ...) stay. Leftovers of another ROS are taken out,
    with a warning, because a message library of another distro causes crashes rather than errors.
    """
    result = without_foreign_ros(target, environ, warns)
    for name in ("PYTHONHOME", BOOTSTRAPPED):
        result.pop(name, None)
    entries = split_path(result.get("PYTHONPATH"))
    other = [entry for entry in entries if is_of_another_python(entry)]
    if other:
        set_path(result, "PYTHONPATH", [entry for entry in entries if entry not in other])
        if warns:
            say(f"{other[0]} on PYTHONPATH belongs to another Python: it is ignored")
    prefixes = [target.install / package.name for package in packages]
    python = [
        target.install / package.name / "lib/python3.12/site-packages"
        if package.is_compiled
        else target.build / package.name
        for package in packages
    ]
    libraries = [target.install / package.name / "lib" for package in packages if package.is_compiled]
    if target.underlay:
        # The executables' shebang may be the system's python3: give it the packages of our environment as well.
        append(result, "PYTHONPATH", [target.site_packages])
    else:
        # Before the user's own entries, which must not replace a locked package.
        python.append(target.site_packages)
        libraries += [target.venv / "lib", *sorted(target.site_packages.glob("ros_*.libs"))]
        prefixes.append(target.venv)
        result[BOOTSTRAPPED] = "1"
    prepend(result, "PATH", [target.venv / "bin"])
    prepend(result, "AMENT_PREFIX_PATH", prefixes)
    prepend(result, "CMAKE_PREFIX_PATH", prefixes)
    prepend(result, "PYTHONPATH", python)
    prepend(result, "LD_LIBRARY_PATH", libraries)
    result["VIRTUAL_ENV"] = str(target.venv)
    result["FBQL_CHECKOUT"] = str(target.root)
    result.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    result.setdefault("PYTHONUNBUFFERED", "1")
    return result


def build_environment(target: Target, environ: Mapping[str, str]) -> dict[str, str]:
    """The variables colcon runs with: those of our processes, but without any built package, and with bytecode."""
    result = process_environment(target, environ, [], warns=False)
    result.pop("PYTHONDONTWRITEBYTECODE", None)
    if not target.underlay:
        result.pop("PYTHONPATH", None)
    for name in [name for name in result if name.startswith("COLCON_")]:
        del result[name]  # such as COLCON_DEFAULTS_FILE, which may choose another layout of the install space
    result["COLCON_HOME"] = str(target.state / "colcon")  # the user's colcon defaults are for other work
    # colcon's own choice has a limit of the load: where other programs keep the machine busy, make would wait for them.
    result.setdefault("MAKEFLAGS", f"-j{len(os.sched_getaffinity(0))}")
    return result


def tool_environment(environ: Mapping[str, str]) -> dict[str, str]:
    """The variables for a Python other than ours, or for pip and uv: none that changes what it imports."""
    dropped = {"PYTHONHOME", "PYTHONPATH", "VIRTUAL_ENV", "__PYVENV_LAUNCHER__", BOOTSTRAPPED}
    return {name: value for name, value in environ.items() if name not in dropped}


def without_foreign_ros(target: Target, environ: Mapping[str, str], warns: bool) -> dict[str, str]:
    """A copy of `environ` without the traces of a ROS other than the target's; warns of what it removes.

    An overlay that was built on our own environment (ours is on AMENT_PREFIX_PATH then) stays.
    """
    result = dict(environ)
    prefixes = split_path(environ.get("AMENT_PREFIX_PATH"))
    if target.underlay:
        return result
    rmw = result.get("RMW_IMPLEMENTATION") or "rmw_fastrtps_cpp"
    if rmw != "rmw_fastrtps_cpp":
        del result["RMW_IMPLEMENTATION"]
        if warns:
            say(f"RMW_IMPLEMENTATION={rmw} is ignored: the wheels contain only rmw_fastrtps_cpp")
    if target.venv in prefixes:
        return result
    for name in ("COLCON_PREFIX_PATH", *OF_A_DISTRO):
        result.pop(name, None)
    prefixes += split_path(environ.get("COLCON_PREFIX_PATH"))
    foreign = [prefix for prefix in prefixes if not is_inside(prefix, target.root)]
    roots = {*foreign, Path("/opt/ros")}
    for name in SEARCH_PATHS:
        set_path(
            result, name, [each for each in split_path(result.get(name)) if roots.isdisjoint((each, *each.parents))]
        )
    if foreign and warns:
        distro = environ.get("ROS_DISTRO")
        what = f"ROS 2 {distro}" if distro and distro != DISTRO else foreign[0]
        say(f"{what} is sourced, which is not a usable system Jazzy: it is ignored, and the Jazzy wheels are used")
    return result


def is_of_another_python(path: Path) -> bool:
    """Whether a directory is the library or the packages of a Python other than 3.12."""
    versions = [re.fullmatch(r"python(\d\.\d+)", part) for part in path.parts]
    return any(version is not None and version[1] != "3.12" for version in versions)


def prepend(environ: dict[str, str], name: str, entries: list[Path]) -> None:
    """Put `entries` first on the search path `name`; those already on it move there."""
    set_path(environ, name, [*entries, *(entry for entry in split_path(environ.get(name)) if entry not in entries)])


def append(environ: dict[str, str], name: str, entries: list[Path]) -> None:
    """Put `entries` last on the search path `name`, unless they are on it."""
    present = split_path(environ.get(name))
    set_path(environ, name, [*present, *(entry for entry in entries if entry not in present)])


def set_path(environ: dict[str, str], name: str, entries: list[Path]) -> None:
    """Set the search path `name`. An empty path removes the variable: an empty entry would mean the working
    directory."""
    if entries:
        environ[name] = os.pathsep.join(map(str, entries))
    else:
        environ.pop(name, None)
