"""A recording read by what Foxglove and Lichtblick read with: @mcap/core, with every CRC checked."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest

PLACE = Path(__file__).parents[1] / "system" / "read_with_node"


def read_with_javascript(path: Path) -> dict[str, Any]:
    """What it finds in a file. Skips the test without Node.js or its modules."""
    modules = Path(os.environ.get("FBQL_NODE_MODULES", PLACE / "node_modules"))
    node = shutil.which("node")
    if node is None or not (modules / "@mcap" / "core").is_dir():
        pytest.skip(f"no Node.js, or no modules in {modules}: npm install --no-package-lock --prefix {PLACE}")
    done = subprocess.run(
        [node, PLACE / "read.cjs", path],
        env=os.environ | {"NODE_PATH": str(modules)},
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)
