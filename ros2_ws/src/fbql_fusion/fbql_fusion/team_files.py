"""The trees of the behaviors, read from their files for a controller that imagines how they would drive.

A behavior's node reads the same file and checks all of it; here it is only checked that the file is complete.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, cast

from fbql_common.core.errors import BadInput
from fbql_common.core.plain_json import json_from
from fbql_common.files import read_file

from fbql_fusion.core.tasks.soccer.world_model.soccer_imagination import PlayingTree
from fbql_fusion.core.tasks.soccer.world_model.team import TreeParts

MAX_BYTES = 8 * 2**20
_ABOUT_THE_FILE = ("format", "version", "sha256")


def read_playing_trees(files: Sequence[Path]) -> list[PlayingTree]:
    """The trees in these files. Raises BadInput, with file and reason in one line, for anything but a complete tree file."""
    return [_read(path) for path in files]


def _read(path: Path) -> PlayingTree:
    data = read_file(path, MAX_BYTES)
    try:
        content = json_from(data)
    except BadInput as error:
        raise BadInput(f"{path}: {error}") from None
    if not isinstance(content, Mapping):
        raise BadInput(f"{path}: not a tree file")
    tree = cast("Mapping[str, Any]", content)
    own = {key: value for key, value in tree.items() if key not in _ABOUT_THE_FILE}
    whole = json.dumps(own, sort_keys=True, separators=(",", ":"), allow_nan=False)
    if hashlib.sha256(whole.encode()).hexdigest() != tree.get("sha256"):
        raise BadInput(f"{path}: not a tree file, or one that was changed or damaged")
    try:
        leaves = [_wheels(leaf) for leaf in tree["leaves"]]
        return PlayingTree(tree["behavior"], TreeParts(tree["nodes"], leaves, tree["sha256"]))
    except (KeyError, TypeError) as error:
        raise BadInput(f"{path}: not a tree that commands wheels ({error!r})") from None


def _wheels(leaf: Mapping[str, Any]) -> tuple[float, float]:
    return float(leaf["left_rad_s"]), float(leaf["right_rad_s"])
