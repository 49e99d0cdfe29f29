"""Trees of least squared error by pystreed, which is not one of our requirements.

pystreed depends on scikit-survival, whose licence is the GPL; a user who wants its numbers installs it beside the project
(`pip install --target DIR pystreed`) and names the directory.

It searches all trees up to a depth and a number of leaves, whose splits are at sixteenths of the root region and whose
leaves answer one of 16 prototypes (k-means of the classes' levels): without those limits it does not finish. The leaves then
get the means of their patterns, as ours have.

Source: van der Linden, de Weerdt, Demirovic, Necessary and Sufficient Conditions for Optimal Decision Trees using Dynamic
Programming (NeurIPS 2023).
"""

from __future__ import annotations

import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from fbql_behaviors.core.boxes import edge
from fbql_behaviors.core.patterns import Patterns
from fbql_behaviors.core.quantizer import levels_of_classes
from fbql_behaviors.core.tree import Leaf, Node, Split, Tree
from fbql_common.core.errors import BadInput

PARTS = 16
PROTOTYPES = 16
TIME_LIMIT_S = 900.0


def make_importable(directory: str) -> None:
    """Lets pystreed be imported from where it was installed. Raises BadInput when it is not there."""
    place = str(Path(directory).absolute())
    if place not in sys.path:
        sys.path.append(place)
    if find_spec("pystreed") is None:
        raise BadInput(f"--pystreed {directory}: it is not there; pip install --target {directory} pystreed")


def optimal_tree(behavior: str, patterns: Patterns, depth: int, leaves: int) -> Tree | None:
    """The tree of least squared error of the wheels' levels within a depth and a number of leaves.

    None when the search does not end in TIME_LIMIT_S.
    """
    from pystreed import STreeDInstanceCostSensitiveClassifier  # type: ignore[import-not-found]
    from sklearn.cluster import KMeans

    levels = levels_of_classes(patterns.wheel_class)
    cuts = [
        (column, edge(feature.low, feature.high, part / PARTS))
        for column, feature in enumerate(patterns.features)
        for part in range(1, PARTS)
    ]
    is_right = np.stack([patterns.x[:, column] >= threshold for column, threshold in cuts], axis=1)
    prototypes = KMeans(min(PROTOTYPES, len(np.unique(levels, axis=0))), n_init=4, random_state=0).fit(levels)
    costs = ((levels[:, None, :] - prototypes.cluster_centers_[None]) ** 2).sum(axis=2)
    model = STreeDInstanceCostSensitiveClassifier(
        max_depth=depth, max_num_nodes=min(leaves - 1, 2**depth - 1), time_limit=TIME_LIMIT_S
    )
    model.fit(is_right.astype(np.int64), costs)
    if not model.fit_result.is_optimal():
        return None
    return as_ours(model.get_tree(), behavior, patterns, cuts)


def as_ours(root: Any, behavior: str, patterns: Patterns, cuts: list[tuple[int, float]]) -> Tree:
    """pystreed's tree converted to ours; its feature k asks whether an attribute is at least the threshold of cut k."""
    nodes: list[Node] = []
    leaves: list[Leaf] = []

    def grow(node: Any) -> int:
        place = len(nodes)
        if node.is_leaf_node():
            nodes.append(len(leaves))
            leaves.append(Leaf(0.0, 0.0, 0))
            return place
        nodes.append(0)  # its place comes before its children's
        column, threshold = cuts[node.feature]
        left = grow(node.left_child)
        right = grow(node.right_child)
        nodes[place] = Split(column, threshold, left, right)
        return place

    grow(root)
    return Tree(behavior, patterns.features, tuple(nodes), tuple(leaves))
