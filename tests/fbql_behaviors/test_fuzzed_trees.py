"""Whatever a tree file holds: it is a tree that answers, or it is refused in one line."""

from __future__ import annotations

import hashlib
import json

from fbql_behaviors.core.explanation import rules
from fbql_behaviors.core.tree import Tree, canonical
from fbql_behaviors.storage import tree_from_bytes, tree_to_bytes
from fuzzing import dice, odd_bytes, odd_copy, read_or_refused
from places import ROOT

TREES = ROOT / "ros2_ws/src/fbql_behaviors/fbql_behaviors/trees"
FILES = [(TREES / f"{name}.json").read_bytes() for name in ("wall_avoiding", "approaching")]


def check(tree: Tree | None) -> None:
    if tree is not None:
        tree.answer([feature.low for feature in tree.features])
        assert len(rules(tree)) == tree.leaf_count
        assert tree_from_bytes(tree_to_bytes(tree)) == tree


def test_mutated_bytes_are_a_tree_or_refused():
    for rng in dice(300):
        data = odd_bytes(rng.choice(FILES), rng, b'[]{}":,0123456789eE+-.nulltruefalseNaNInfinity')
        check(read_or_refused(lambda data=data: tree_from_bytes(data)))


def test_mutated_content_with_its_hash_is_a_tree_or_refused():
    """The hash fits: what is wrong must be found in the content."""
    for rng in dice(300):
        content = odd_copy(json.loads(rng.choice(FILES)), rng)
        if isinstance(content, dict) and rng.random() < 0.9:
            hashed = {name: content.get(name) for name in ("behavior", "features", "nodes", "leaves", "origin")}
            content["sha256"] = hashlib.sha256(canonical(hashed).encode()).hexdigest()
        data = json.dumps(content).encode()
        check(read_or_refused(lambda data=data: tree_from_bytes(data)))
