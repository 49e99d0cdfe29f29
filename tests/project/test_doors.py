"""Every program in scripts/, benchmarks/ and docs/ starts: a door is nowhere else in the suite."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from patience import PATIENCE_S
from places import ROOT

DOORS = sorted(
    path
    for folder in ("scripts", "benchmarks", "docs")
    for path in (ROOT / folder).glob("*.py")
    if "enter(" in path.read_text() and path.name != "test.py"
)


def test_there_are_doors() -> None:
    assert len(DOORS) >= 17


@pytest.mark.parametrize("door", DOORS, ids=lambda path: f"{path.parent.name}/{path.name}")
def test_a_door_opens_and_is_short(door: Path) -> None:
    done = subprocess.run(
        [sys.executable, str(door), "--help"], capture_output=True, text=True, timeout=PATIENCE_S, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith(f"usage: {door.name}")
    assert len(door.read_text().splitlines()) <= 16
