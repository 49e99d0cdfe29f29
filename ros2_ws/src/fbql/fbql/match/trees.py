"""The trees of a match, in the form that a controller needs to imagine how they would drive."""

from __future__ import annotations

from collections.abc import Iterable

from fbql_behaviors.core.tree import Tree
from fbql_common.core.field import WHEELS
from fbql_fusion.core.tasks.soccer.world_model.soccer_imagination import PlayingTree
from fbql_fusion.core.tasks.soccer.world_model.team import TreeParts


def playing_trees(trees: Iterable[Tree]) -> list[PlayingTree]:
    """The trees of the behaviors, in order, for a `SoccerSession`."""
    return [
        PlayingTree(tree.behavior, TreeParts(tree.nodes, [leaf.command for leaf in tree.leaves], tree.hash))
        for tree in trees
        if tree.commands == WHEELS
    ]
