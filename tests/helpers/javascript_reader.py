"""A recording read by what Foxglove and Lichtblick read with: @mcap/core, with every CRC checked."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest
from patience import PATIENCE_S

PLACE = Path(__file__).with_name("read_with_node")


MODULES = Path(os.environ.get("FBQL_NODE_MODULES", PLACE / "node_modules"))
NODE = shutil.which("node")
IS_THERE = NODE is not None and (MODULES / "@mcap" / "core").is_dir()


def read_with_javascript(path: Path) -> dict[str, Any]:
    """What it finds in a file. Skips the test without Node.js or its modules."""
    if not IS_THERE:
        pytest.skip(f"no Node.js, or no modules in {MODULES}: npm install --no-package-lock --prefix {PLACE}")
    done = subprocess.run(
        [NODE, PLACE / "read.cjs", path],
        env=os.environ | {"NODE_PATH": str(MODULES)},
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)
