"""Finding a Python 3.12 on which the environment can be built."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

from .progress import SetUpError
from .target import matches
from .variables import tool_environment

# Runs in the candidate, whatever version it is. `real` is the interpreter behind a virtual environment.
PROBE = """
import json, os, platform, struct, sys, sysconfig
def has(name):
    try:
        __import__(name)
    except Exception:
        return False
    return True
print(json.dumps({
    "version": list(sys.version_info[:3]),
    "build": [platform.python_implementation(), platform.machine(), struct.calcsize("P") * 8],
    "libc": platform.libc_ver()[0],
    "real": getattr(sys, "_base_executable", None) or sys.executable,
    "venv": has("venv"),
    "ensurepip": has("ensurepip"),
    "headers": os.path.exists(os.path.join(sysconfig.get_path("include"), "Python.h")),
    "rclpy": has("rclpy"),
}))
"""


class Interpreter(NamedTuple):
    """A Python that was tried and can be used."""

    executable: str
    version: str
    has_ensurepip: bool


def find_interpreter(environ: Mapping[str, str], *, with_rclpy: bool = False) -> Interpreter:
    """The first usable Python 3.12 among the candidates.

    `with_rclpy`: it must import rclpy with `environ` as it is, which the Python of a system ROS does.
    Raises SetUpError with instructions when there is none.
    """
    check_platform()
    refused: list[str] = []
    for candidate in dict.fromkeys(candidates(environ)):
        if os.access(candidate, os.X_OK):
            found = probe(candidate, environ, with_rclpy=with_rclpy)
            if isinstance(found, Interpreter):
                return found
            refused += [f"{candidate} {found}"] if found else []
    tried = f" Tried: {'; '.join(refused)}." if refused else ""
    if with_rclpy:
        raise SetUpError(
            f"no Python 3.12 imports rclpy of the sourced ROS 2 Jazzy.{tried} Source its setup.bash in a fresh shell, "
            "or start without it to use the wheels."
        )
    raise SetUpError(
        "no usable Python 3.12 found. Install one, for example with `sudo apt install python3.12-venv python3.12-dev`, "
        f"`pyenv install 3.12` or `uv python install 3.12`, and start again.{tried}"
    )


def check_platform() -> None:
    """Raise SetUpError if there are no wheels for this platform."""
    system, machine = os.uname().sysname, os.uname().machine
    if (system, machine) != ("Linux", "x86_64"):
        raise SetUpError(
            f"the ROS 2 wheels exist for Linux on x86-64 only; this is {system} on {machine}. "
            "Use such a machine or a container."
        )


def candidates(environ: Mapping[str, str]) -> Iterator[str]:
    """Paths that may be a Python 3.12, the likeliest first; uv, which downloads nothing here, is tried last."""
    if sys.version_info[:2] == (3, 12):
        yield sys.executable
    directories = [entry for entry in environ.get("PATH", "").split(os.pathsep) if entry]
    yield from (f"{directory}/{name}" for name in ("python3.12", "python3", "python") for directory in directories)
    pyenv = Path(environ.get("PYENV_ROOT") or Path(environ.get("HOME", "/"), ".pyenv"))
    versions = [path for path in matches(pyenv, "versions/3.12.*") if path.name.split(".")[2].isdigit()]
    for path in sorted(versions, key=lambda path: int(path.name.split(".")[2]), reverse=True):
        yield str(path / "bin" / "python3.12")
    uv = shutil.which("uv", path=environ.get("PATH"))
    if uv:
        known = output_of([uv, "python", "find", "--no-project", "3.12"], tool_environment(environ))
        yield from [known.strip()] if known else []


def probe(candidate: str, environ: Mapping[str, str], *, with_rclpy: bool) -> Interpreter | str:
    """Try a candidate by running it: the interpreter, or the reason against it; the reason is empty for just another
    version."""
    # -I keeps the environment's variables out of it; with a system ROS they are what makes rclpy importable.
    command = [candidate, *([] if with_rclpy else ["-I"]), "-c", PROBE]
    try:
        facts = json.loads(output_of(command, dict(environ) if with_rclpy else tool_environment(environ)))
    except ValueError:
        return "does not start" if candidate.endswith("python3.12") else ""
    if facts["version"][:2] != [3, 12]:
        return ""
    implementation, machine, bits = facts["build"]
    has_uv = shutil.which("uv", path=environ.get("PATH")) is not None
    reasons = {
        f"is {implementation} for {bits}-bit {machine}, and CPython for x86-64 is needed": facts["build"]
        == ["CPython", "x86_64", 64],
        "is not built for glibc, which the wheels need": facts["libc"] == "glibc",
        "has no venv module (apt install python3.12-venv)": facts["venv"],
        "has no C headers (apt install python3.12-dev)": facts["headers"],
        "does not import rclpy": facts["rclpy"] or not with_rclpy,
        "has no ensurepip module (apt install python3.12-venv)": facts["ensurepip"] or has_uv,
    }
    usable = Interpreter(facts["real"], ".".join(map(str, facts["version"])), facts["ensurepip"])
    return next((reason for reason, holds in reasons.items() if not holds), usable)


def output_of(command: list[str], environ: dict[str, str]) -> str:
    """What a short program prints; empty when it fails, hangs or is not a program."""
    environ["UV_PYTHON_DOWNLOADS"] = "never"
    try:
        done = subprocess.run(
            command, env=environ, stdin=subprocess.DEVNULL, capture_output=True, timeout=30, check=False
        )
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return done.stdout.decode(errors="replace") if done.returncode == 0 else ""
