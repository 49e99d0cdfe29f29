"""The whole repository is formatted, linted and type-checked. The tools are those of requirements/test.txt."""

from __future__ import annotations

import subprocess
import sys

from places import ROOT


def say_nothing(*command: str) -> None:
    """Fails, with everything that the tool has to say, unless it has nothing to say."""
    done = subprocess.run(
        [sys.executable, "-m", *command], cwd=ROOT, capture_output=True, text=True, timeout=850, check=False
    )
    assert done.returncode == 0, f"{' '.join(command)}\n{done.stdout}{done.stderr}"


def test_every_file_is_formatted() -> None:
    say_nothing("ruff", "format", "--check", "--quiet", "--no-cache", ".")


def test_every_file_passes_the_linter() -> None:
    say_nothing("ruff", "check", "--quiet", "--no-cache", ".")


def test_every_core_passes_the_strict_type_checker() -> None:
    # The configuration names .venv; the environment that runs the tests may be another one.
    say_nothing("basedpyright", "--pythonpath", sys.executable)
