"""What tests of recordings share."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest


@pytest.fixture
def run(recorded: Path, tmp_path: Path) -> Path:
    """A copy of the module's recording, to be changed."""
    return Path(shutil.copytree(recorded, tmp_path / "run"))
