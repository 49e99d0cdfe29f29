"""Lesson 3: reading a tree, and changing one leaf of it."""

from __future__ import annotations

from collections.abc import Sequence
from math import radians
from pathlib import Path

from fbql_behaviors.core.explanation import Motion, motion_of, rules
from fbql_behaviors.storage import load_tree
from fbql_common.core.errors import BadInput

from fbql.cli.places import command_text
from fbql.course.driving import BEHAVIOR, attempts_of, skill_text
from fbql.course.verdict import Verdict, leaf_of, made, words_of

TREE, CHANGED = f"small/{BEHAVIOR}.json", f"changed/{BEHAVIOR}.json"
AT = "1,30"
"""The place that is asked about, as `tree explain --at` takes it: the ball 1 m away, 30 degrees to the left."""
_PLACE = (1.0, radians(30.0))
WANTED = Motion.SPIN_LEFT


def check(answer: Sequence[str], work: Path) -> Verdict:
    """Compares the answer LEAF with the tree, and the changed tree with the tree."""
    (leaf,) = words_of(answer, "LEAF", "12")
    leaf_id = leaf_of(leaf)
    tree = load_tree(made(work / TREE))
    if tree.behavior != BEHAVIOR:
        raise BadInput(f"{work / TREE}: a tree of {tree.behavior}, not of {BEHAVIOR}; make it again")
    if leaf_id != tree.answer(_PLACE)[0]:
        here = f"leaf {leaf_id} answers where: {rules(tree)[leaf_id].where}" if leaf_id < tree.leaf_count else (
            f"there is no leaf {leaf_id}, the last one is {tree.leaf_count - 1}"
        )  # fmt: skip
        command = f"{command_text('tree')} explain {work / TREE} --at {AT}"
        return Verdict(False, f"{here}; read on for the ball 1 m away and 30 degrees to the left, or ask: {command}")
    changed = load_tree(made(work / CHANGED))
    if (changed.nodes, changed.features) != (tree.nodes, tree.features):
        return Verdict(False, f"the changed tree has other regions; change a leaf of {work / TREE}")
    pairs = enumerate(zip(tree.wheel_leaves, changed.wheel_leaves, strict=True))
    others = [k for k, (before, after) in pairs if before != after and k != leaf_id]
    if others:
        names = ", ".join(str(k) for k in others[:5])
        return Verdict(
            False, f"only leaf {leaf_id} should change, but {names} changed too; start again from {work / TREE}"
        )
    motion = motion_of(*changed.wheel_leaves[leaf_id].command)
    if motion is not WANTED:
        return Verdict(
            False,
            f"with your change leaf {leaf_id} means: {motion.value}; it should mean: {WANTED.value}; for that, the right wheel "
            "goes forwards and the left one backwards, equally fast",
        )
    return Verdict(
        True,
        f"leaf {leaf_id} now means: {WANTED.value}; your tree reaches the ball from {skill_text(attempts_of(changed))}, before "
        f"the change from {skill_text(attempts_of(tree))}",
    )
