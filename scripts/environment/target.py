"""One environment: where it is, what is installed and built in it, and what that was made from.

Every start uses it, so it imports little and reads little: lock files, package.xml and its like, the sources of
compiled packages. A Python package is linked into the build space, so edits of its modules do not matter here.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
from collections import namedtuple
from pathlib import Path

DISTRO = "jazzy"
EXTRAS = ("test", "study", "bags")
"""What can be installed in addition to what every command needs ("run")."""
OF_THE_SYSTEM = ("numpy", "pyyaml")
"""The packages of the locks that a system ROS provides."""
ENVIRONMENT_STAMP = "fbql-environment.json"
BUILD_STAMP = ".fbql-build.json"
UNFINISHED = "fbql-unfinished"
"""Exists in an environment while it is being changed: if found later, the work was interrupted at an unknown point."""
METADATA = ("package.xml", "setup.py", "setup.cfg", "pyproject.toml")
NOT_SOURCE = ("__pycache__", "build", "dist")
DOCUMENTS = (".md", ".rst")
IGNORED = ("COLCON_IGNORE", "AMENT_IGNORE")

Package = namedtuple("Package", "name path is_compiled")


class Target:
    """Places of one environment. `underlay` holds the prefixes of a system Jazzy; it is empty with the wheels."""

    def __init__(self, root: Path, underlay: tuple[Path, ...] = ()) -> None:
        self.root = root
        self.underlay = underlay
        self.state = root / ".setup"
        self.venv = root / (".venv-system" if underlay else ".venv")
        self.python = self.venv / "bin" / "python"
        self.site_packages = self.venv / "lib" / "python3.12" / "site-packages"
        self.workspace = root / "ros2_ws"
        made = self.state / "system" if underlay else self.workspace
        self.build, self.install, self.log = made / "build", made / "install", made / "log"

    def locks(self, purpose: str) -> list[Path]:
        """The lock files of a purpose: "run" or one of EXTRAS."""
        names = [*([] if self.underlay else ["ros"]), "run", *([] if purpose == "run" else [purpose])]
        return [self.root / "requirements" / f"{name}.txt" for name in names]

    def lock_hash(self, purpose: str) -> str:
        """The hash of the contents of a purpose's lock files."""
        return digest([path.read_bytes() for path in self.locks(purpose)])

    def requirements(self, purposes: list[str]) -> dict[str, str]:
        """Every `name==version` that the locks name for the purposes, with its hashes, by name."""
        found: dict[str, str] = {}
        for path in dict.fromkeys(path for purpose in purposes for path in self.locks(purpose)):
            found.update(lock_entries(path.read_text()))
        return {name: text for name, text in found.items() if not (self.underlay and name in OF_THE_SYSTEM)}

    def installed(self) -> dict[str, str]:
        """The lock hash of each purpose that is installed; empty without an environment that can be installed into.

        A usable environment was created completely, has not been moved, and is based on a Python that still exists.
        """
        stamp = read_stamp(self.venv / ENVIRONMENT_STAMP)
        is_moved = stamp.pop("path", None) != str(self.venv)
        return {} if is_moved or (self.venv / UNFINISHED).exists() or not os.access(self.python, os.X_OK) else stamp

    def has_installed(self, purpose: str) -> bool:
        """Whether the environment contains what the locks require now."""
        return self.installed().get(purpose) == self.lock_hash(purpose)

    def is_ready(self, purpose: str, packages: list[Package]) -> bool:
        """Whether everything is installed and built from the checkout's current contents."""
        return self.has_installed(purpose) and not self.stale(packages) and not self.leftovers(packages)

    def packages(self) -> list[Package]:
        """The packages of the workspace, by name."""
        found: list[Package] = []
        for place, subdirectories, files in os.walk(self.workspace / "src"):
            subdirectories[:] = [name for name in subdirectories if not name.startswith(".")]
            if any(name in files for name in IGNORED):
                subdirectories.clear()
            elif "package.xml" in files:
                subdirectories.clear()
                text = Path(place, "package.xml").read_text(errors="replace")
                name = re.search(r"<name>\s*([^<\s]+)\s*</name>", text)
                found.append(Package(name[1] if name else "", Path(place), "<build_type>ament_python<" not in text))
        return sorted(found)

    def stale(self, packages: list[Package]) -> list[str]:
        """The packages that were not built from their current sources."""
        stamps = {name: self.stamp(name, text) for name, text in self.fingerprints(packages).items()}
        held = {name: read_stamp(self.install / name / BUILD_STAMP) for name in stamps}
        return [name for name, stamp in stamps.items() if not stamp["built_ns"] or held[name] != stamp]

    def stamp(self, name: str, fingerprint: str) -> dict[str, object]:
        """The content of an up-to-date package's stamp.

        The time of the file that colcon writes last is in it: if somebody else built over our install space (a plain
            `colcon build`), or the package is incomplete, the stamp does not match.
        """
        written = self.install / name / "share" / name / "package.sh"
        return {"fingerprint": fingerprint, "built_ns": written.stat().st_mtime_ns if written.exists() else 0}

    def leftovers(self, packages: list[Package]) -> list[Path]:
        """Packages that the set-up built and whose source is gone."""
        names = {package.name for package in packages}
        made = os.scandir(self.install) if self.install.is_dir() else ()
        return [Path(entry) for entry in made if entry.name not in names and Path(entry, BUILD_STAMP).exists()]

    def fingerprints(self, packages: list[Package]) -> dict[str, str]:
        """What each package would be built from, as a hash: its own files, the environment, the locks.

        For a compiled package that is all files of every compiled package, since an interface is compiled into its
        users.
        """
        configuration = self.venv / "pyvenv.cfg"
        places = (self.venv, self.install, *self.underlay, configuration.read_text() if configuration.exists() else "")
        common = [*(str(place).encode() for place in places), self.lock_hash("run").encode()]
        cmake = [self.workspace / "colcon.meta", *sorted((self.root / "cmake").glob("*.cmake"))]
        compiled = [contents(path) for path in cmake]
        for package in packages:
            compiled += linked_parts(package.path, every=True) if package.is_compiled else []
        return {
            package.name: digest([*common, *(compiled if package.is_compiled else linked_parts(package.path))])
            for package in packages
        }


def target_for(root: Path, environ: dict[str, str]) -> Target:
    """The environment that belongs to the checkout `root`, started with the variables `environ`.

    A system Jazzy counts as sourced if ROS_DISTRO names it and a prefix outside of this checkout holds rclpy.
    """
    prefixes = [prefix for prefix in split_path(environ.get("AMENT_PREFIX_PATH")) if not is_inside(prefix, root)]
    holds_ros = any(matches(prefix, "lib/python3*/*-packages/rclpy") for prefix in prefixes)
    return Target(root, tuple(prefixes) if holds_ros and environ.get("ROS_DISTRO") == DISTRO else ())


def linked_parts(directory: Path, *, every: bool = False) -> list[bytes]:
    """What a package's build depends on: the names of its files but modules, with the content of those that describe it.

    With `every`, the content of all but documents.
    """
    parts: list[bytes] = []
    for place, subdirectories, files in os.walk(directory):
        is_top = place == str(directory)
        subdirectories[:] = sorted(
            name
            for name in subdirectories
            if not name.startswith(".") and name not in NOT_SOURCE and "egg-info" not in name
        )
        parts += [name.encode() for name in subdirectories if is_top and not every]
        for name in sorted(files):
            if name.startswith(".") or name.endswith(".pyc") or (name.endswith(".py") and not (every or is_top)):
                continue
            path = Path(place, name)
            parts.append(os.fsencode(path.relative_to(directory)))
            if (every and not name.endswith(DOCUMENTS)) or (is_top and name in METADATA):
                parts.append(contents(path))
    return parts


def contents(path: Path) -> bytes:
    """The bytes of a file, after its mode; empty for one that cannot be read (a broken link)."""
    try:
        return (b"x" if os.access(path, os.X_OK) else b"-") + path.read_bytes()
    except OSError:
        return b"?"


def digest(parts: list[bytes]) -> str:
    """SHA-256 of a list of byte strings, with their lengths, so that no two lists give the same bytes."""
    total = hashlib.sha256()
    for part in parts:
        total.update(len(part).to_bytes(8, "little") + part)
    return total.hexdigest()


def read_stamp(path: Path) -> dict[str, object]:
    """The stamp at `path`; empty if there is none, or if it is not readable as one."""
    try:
        stamp = json.loads(path.read_bytes())
    except (OSError, ValueError):
        return {}
    return stamp if isinstance(stamp, dict) else {}


def write_stamp(path: Path, stamp: dict[str, object]) -> None:
    """Replace the stamp at `path` in one step: a reader sees either the complete old one or the complete new one."""
    temporary = path.with_name(f"{path.name}.{os.getpid()}")
    with temporary.open("w") as file:
        json.dump(stamp, file, indent=1)
        file.flush()
        os.fsync(file.fileno())
    temporary.replace(path)


def lock_entries(lock: str) -> dict[str, str]:
    """The entries of a lock file by name: each `name==version` with the hashes that follow it."""
    blocks = re.findall(r"^([A-Za-z0-9][\w.-]*)((?:\[[^\]]*\])?==.*(?:\n[ \t].*)*)", lock, flags=re.MULTILINE)
    return {name.lower(): name + rest for name, rest in blocks}


def split_path(value: str | None) -> list[Path]:
    """The entries of a search path variable."""
    return [Path(entry) for entry in (value or "").split(os.pathsep) if entry]


def is_inside(path: Path, directory: Path) -> bool:
    """Whether `path`, as written or with its links followed, is `directory` or below it."""
    resolved = path.resolve()
    return directory in (path, *path.parents, resolved, *resolved.parents)


def matches(directory: Path, pattern: str) -> list[Path]:
    """The paths of a directory that somebody named; none where it can't be read, such as for a name that is too long."""
    try:
        return list(directory.glob(pattern))
    except OSError:
        return []
