"""The colcon workspace: its packages, what each was built from, and which are to be built again. Quick: every start
asks it. Each package's fingerprint covers all of its files, so an edit, a new file and a removed one are all seen.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

from . import stamps
from .errors import SetUpError
from .target import Target

STAMP = ".fbql-build.json"
IGNORED = ("COLCON_IGNORE", "AMENT_IGNORE")
NOT_SOURCE = ("__pycache__",)
BUILD_OUTPUT = ("build", "dist")  # what `pip install` leaves in a package's own directory


@dataclass(frozen=True)
class Package:
    """A package of the workspace, as its package.xml has it."""

    name: str
    path: Path
    build_type: str
    dependencies: frozenset[str]

    @property
    def is_compiled(self) -> bool:
        """Whether building it takes CMake and a compiler."""
        return self.build_type != "ament_python"


def find_packages(source: Path) -> list[Package]:
    """The packages below `source`, by name. Raises SetUpError for a package.xml that is none."""
    packages: list[Package] = []
    for directory, subdirectories, files in os.walk(source):
        if any(name in files for name in IGNORED):
            subdirectories.clear()
        elif "package.xml" in files:
            subdirectories.clear()
            packages.append(read_package(Path(directory)))
        subdirectories[:] = [name for name in subdirectories if not name.startswith(".")]
    return sorted(packages, key=lambda package: package.name)


def read_package(directory: Path) -> Package:
    """The package in `directory`."""
    manifest = directory / "package.xml"
    try:
        root = ElementTree.parse(manifest).getroot()
    except ElementTree.ParseError as error:
        raise SetUpError(f"{manifest} is no XML: {error}. Mend it and start again.") from None
    name = (root.findtext("name") or "").strip()
    if not name:
        raise SetUpError(f"{manifest} has no <name>. Mend it and start again.")
    dependencies = (element.text or "" for element in root.iter() if element.tag.endswith("depend"))
    build_type = (root.findtext("export/build_type") or "ament_cmake").strip()
    return Package(name, directory, build_type, frozenset(text.strip() for text in dependencies))


def source_files(directory: Path) -> Iterator[Path]:
    """The files of a package, in a fixed order, without what running or installing it leaves there."""
    for place, subdirectories, files in os.walk(directory):
        is_top = Path(place) == directory
        subdirectories[:] = sorted(
            name
            for name in subdirectories
            if not name.startswith(".")
            and not name.endswith(".egg-info")
            and name not in NOT_SOURCE
            and not (is_top and name in BUILD_OUTPUT)
        )
        for name in sorted(files):
            if not name.startswith(".") and not name.endswith(".pyc"):
                yield Path(place, name)


def fingerprints(target: Target, packages: list[Package]) -> dict[str, str]:
    """What each package would be built from, as a hash.

    Beside its own files that is the environment (where it is, which Python, which lock), for a compiled package the
    CMake options, and whatever compiled package of the workspace it depends on, since their interface is built in.
    """
    by_name = {package.name: package for package in packages}
    environment = [str(target.venv), str(target.install), *map(str, target.underlay), base_python(target.venv)]
    common = [*(text.encode() for text in environment), target.run_lock.read_bytes()]
    cmake_files = [target.workspace / "colcon.meta", *sorted((target.root / "cmake").glob("*.cmake"))]
    cmake = [part for path in cmake_files if path.is_file() for part in (path.name.encode(), path.read_bytes())]
    result: dict[str, str] = {}

    def fingerprint(package: Package, dependents: tuple[str, ...]) -> str:
        if package.name in dependents:
            raise SetUpError(
                f"the packages {', '.join(dependents)} depend on each other in a circle. Mend package.xml."
            )
        if package.name not in result:
            compiled = [
                by_name[name] for name in sorted(package.dependencies) if name in by_name and by_name[name].is_compiled
            ]
            below = [fingerprint(dependency, (*dependents, package.name)).encode() for dependency in compiled]
            own = digest([*common, *(cmake if package.is_compiled else []), *below, *file_parts(package.path)])
            result[package.name] = own
        return result[package.name]

    for package in packages:
        fingerprint(package, ())
    return result


def file_parts(directory: Path) -> Iterator[bytes]:
    """Name, mode and content of every source file below `directory`."""
    for path in source_files(directory):
        yield str(path.relative_to(directory)).encode(errors="surrogateescape")
        try:
            yield b"x" if os.access(path, os.X_OK) else b"-"
            yield path.read_bytes()
        except OSError:  # a broken link, or a file that an editor just took away
            yield b"?"


def digest(parts: list[bytes]) -> str:
    """SHA-256 of a list of byte strings, with their lengths, so that no two lists run into the same bytes."""
    total = hashlib.sha256()
    for part in parts:
        total.update(len(part).to_bytes(8, "little"))
        total.update(part)
    return total.hexdigest()


def base_python(venv: Path) -> str:
    """The interpreter that `venv` stands on, as its pyvenv.cfg names it; empty when there is none."""
    try:
        lines = (venv / "pyvenv.cfg").read_text().splitlines()
    except OSError:
        return ""
    return next((line for line in lines if line.startswith("home")), "")


def build_stamp(target: Target, name: str, fingerprint: str) -> dict[str, object]:
    """What the stamp of an up-to-date installed package holds.

    The time of a file that colcon writes last in every build is in it: when somebody else built over our install
    space (a plain `colcon build` with another ROS), the stamp no longer fits.
    """
    written = written_last(target, name)
    return {"fingerprint": fingerprint, "built_ns": written.stat().st_mtime_ns if written.exists() else None}


def written_last(target: Target, name: str) -> Path:
    """The file that colcon writes last for a package: without it there is no whole package."""
    return target.install / name / "share" / name / "package.sh"


def stale_packages(target: Target, wanted: dict[str, str]) -> list[str]:
    """The packages whose installed form was not built from what is there now."""
    return [
        name
        for name, fingerprint in wanted.items()
        if not written_last(target, name).exists()
        or stamps.read(target.install / name / STAMP) != build_stamp(target, name, fingerprint)
    ]


def leftover_packages(target: Target, wanted: dict[str, str]) -> list[Path]:
    """Installed packages whose source is gone."""
    if not target.install.is_dir():
        return []
    return sorted(path for path in target.install.iterdir() if path.is_dir() and path.name not in wanted)
