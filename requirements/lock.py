"""Writes the lock files beside this one from the root's pyproject.toml: python3 requirements/lock.py [--upgrade]

A pin stays as it is unless pyproject.toml rules it out or --upgrade is given. Needs Python >= 3.11 and the network; takes uv
from PATH, or installs it in a temporary environment.
"""

import argparse
import shutil
import subprocess
import sys
import tempfile
import tomllib
import venv
from pathlib import Path

PLACE = Path(__file__).resolve().parent
LOCKS = {
    "ros": ("dependency-groups.ros",),
    "run": ("project.dependencies",),
    "test": ("project.dependencies", "project.optional-dependencies.test"),
    "bags": ("project.dependencies", "project.optional-dependencies.bags"),
    "study": ("project.dependencies", "project.optional-dependencies.studies", "project.optional-dependencies.bags"),
    "foxglove": ("project.optional-dependencies.foxglove",),
    "peers": ("project.optional-dependencies.peers",),
    "rooms": ("project.optional-dependencies.rooms",),
}
"""Lock -> the lists of pyproject.toml that it covers. No lock contradicts one above it."""


def main() -> None:
    """Write every lock."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--upgrade", action="store_true", help="take the newest versions that fit")
    options = ["--upgrade"] if parser.parse_args().upgrade else []
    project = tomllib.loads((PLACE.parent / "pyproject.toml").read_text())
    with tempfile.TemporaryDirectory() as temporary:
        uv = shutil.which("uv") or install_uv(Path(temporary))
        for number, (name, keys) in enumerate(LOCKS.items()):
            constraints = [word for above in list(LOCKS)[:number] for word in ("-c", f"{above}.txt")]
            wanted = [each for key in keys for each in values(project, key) if not each.startswith("fbql[")]
            command = [uv, "pip", "compile", "--quiet", "--no-config", "--python-version", "3.12", "--generate-hashes"]
            command += ["--no-header", "--no-annotate", "--output-file", f"{name}.txt", *options, *constraints, "-"]
            subprocess.run(command, cwd=PLACE, input="\n".join(wanted), text=True, check=True)
            print(f"{name}.txt: {(PLACE / f'{name}.txt').read_text().count('==')} packages")


def values(project: dict, key: str) -> list[str]:
    """The list at a dotted key."""
    for part in key.split("."):
        project = project[part]
    return project


def install_uv(place: Path) -> str:
    """Install uv in an environment at `place`; its path."""
    venv.create(place, with_pip=True)
    subprocess.run([place / "bin" / "pip", "install", "--quiet", "uv"], stdout=sys.stderr, check=True)
    return str(place / "bin" / "uv")


if __name__ == "__main__":
    main()
