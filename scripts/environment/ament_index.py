"""Packages and executables by the ament index, as `ros2 run` and `ros2 pkg` look them up.

The index is files: a prefix holds a package when it has the marker share/ament_index/resource_index/packages/NAME.
Of several prefixes the first on AMENT_PREFIX_PATH wins.
"""

from __future__ import annotations

import os
from pathlib import Path

MARKERS = Path("share", "ament_index", "resource_index", "packages")


def packages(prefixes: list[Path]) -> dict[str, Path]:
    """Every package found, with its prefix."""
    found: dict[str, Path] = {}
    for prefix in prefixes:
        markers = prefix / MARKERS
        for marker in markers.iterdir() if markers.is_dir() else ():
            if not marker.name.startswith("."):
                found.setdefault(marker.name, prefix)
    return found


def executables(prefix: Path, package: str) -> list[Path]:
    """The executable files of a package, sorted."""
    paths: list[Path] = []
    for directory, subdirectories, files in os.walk(prefix / "lib" / package):
        subdirectories[:] = [name for name in subdirectories if not name.startswith(".")]
        paths += [path for name in files if os.access(path := Path(directory, name), os.X_OK)]
    return sorted(paths)
