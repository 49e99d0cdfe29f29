"""A tree from recorded teleoperation as a source.

`way_round.json` was induced from 12 drives of the scripted operator (`teleoperation`), by the commands in examples/rooms/README.md. It
senses what the mux senses of the scan, and the goal's bearing.
"""

from __future__ import annotations

from pathlib import Path

from fbql_behaviors.core.tree import Tree
from fbql_behaviors.storage import load_tree

from fbql_studies.rooms.robot import Ranges
from fbql_studies.rooms.sources import SOURCES, Command, Source, sectors

TREE = "tree"
SHIPPED = Path(__file__).parent / "way_round.json"


def source_of(tree: Tree) -> Source:
    """A tree of linear.x and angular.z as a source."""

    def follow(ranges: Ranges, distance: float, bearing: float) -> Command:
        _, v, w = tree.answer((bearing, *sectors(ranges)))
        return v, w

    return follow


def sources_with_tree() -> dict[str, Source]:
    """SOURCES, followed by the shipped tree."""
    return {**SOURCES, TREE: source_of(load_tree(SHIPPED))}
