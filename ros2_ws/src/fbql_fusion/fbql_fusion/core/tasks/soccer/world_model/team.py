"""The behaviors in imagination: their trees as arrays, and what they sense of a state."""

from __future__ import annotations

from collections.abc import Sequence
from math import asin, atan2, isfinite, pi, sqrt
from typing import NamedTuple

import numpy as np
from fbql_common.core.errors import BadInput
from fbql_common.core.field import FIELD
from fbql_common.core.geometry import DETOUR_GAIN, DETOUR_RADIUS_M
from fbql_common.core.kernels import kernel
from fbql_common.core.walls import closest_wall
from numpy.typing import NDArray

from fbql_fusion.core.learners.linear import Floats
from fbql_fusion.core.tasks.soccer.world_model.model import State, wrapped

SENSES = {"ball_seeking": 0, "wall_avoiding": 1, "approaching": 2}
"""The observations that can be imagined, by the names of their behaviors."""
SENSED = 2
"""Numbers that each of them has."""
_BALL, _WALL, _APPROACH = SENSES.values()
_HALF_LENGTH = FIELD.half_length_m


class TreeParts(NamedTuple):
    """A behavior's tree, as its file has it."""

    nodes: Sequence[Sequence[float] | int]
    """Node 0 is the root. A split is (feature, threshold, left, right), a leaf its leaf_id."""
    leaves: Sequence[Sequence[float]]
    """Left and right reference first [rad/s], by leaf_id."""
    tree_hash: str


class Trees(NamedTuple):
    """The trees of n behaviors, one after the other; the input of kernels."""

    senses: NDArray[np.int64]
    """Values of SENSES, [n]."""
    roots: NDArray[np.int64]
    """[n]"""
    nodes: Floats
    """The feature that a node splits on, the threshold, the left and the right child; of a leaf -1, 0, its leaf_id and 0,
    [nodes, 4]."""
    first_leaves: NDArray[np.int64]
    """The row of `references` that a behavior's leaf 0 has, [n]."""
    references: Floats
    """Left and right [rad/s], [leaves of all, 2]."""


class Team:
    """The behaviors that are imagined.

    Args:
        trees: of n behaviors.
        senses: the name in SENSES of what each of them senses, length n.

    Raises:
        BadInput: something that is not a tree.
    """

    def __init__(self, trees: Sequence[TreeParts], senses: Sequence[str]) -> None:
        self.hashes = tuple(tree.tree_hash for tree in trees)
        roots: list[int] = []
        first_leaves: list[int] = []
        nodes: list[tuple[int, float, int, int]] = []
        references: list[tuple[float, float]] = []
        for tree, sense in zip(trees, senses, strict=True):
            roots.append(len(nodes))
            first_leaves.append(len(references))
            nodes += _nodes_of(tree, f"tree of {sense}", len(nodes))
            references += [(float(left), float(right)) for left, right, *_ in tree.leaves]
        self.trees = Trees(
            np.array([SENSES[sense] for sense in senses], dtype=np.int64),
            np.array(roots, dtype=np.int64),
            np.array(nodes, dtype=np.float64),
            np.array(first_leaves, dtype=np.int64),
            np.array(references, dtype=np.float64).reshape(-1, 2),
        )

    def __len__(self) -> int:
        """n"""
        return len(self.hashes)


def _nodes_of(tree: TreeParts, where: str, first: int) -> list[tuple[int, float, int, int]]:
    """The nodes as rows of arrays. Raises BadInput unless they are a tree: each is reached once, and every leaf exists."""
    nodes: list[tuple[int, float, int, int]] = []
    reached = [0] + [
        child for node in tree.nodes if not isinstance(node, int) for child in (int(node[2]), int(node[3]))
    ]
    if sorted(reached) != list(range(len(tree.nodes))) or not _is_connected(tree):
        raise BadInput(f"{where}: its nodes are not a tree")
    for index, node in enumerate(tree.nodes):
        if isinstance(node, int):
            if not 0 <= node < len(tree.leaves):
                raise BadInput(f"{where}: leaf {node} does not exist")
            nodes.append((-1, 0.0, node, 0))
        else:
            feature, threshold, left, right = node
            if feature not in range(SENSED) or not isfinite(threshold):
                raise BadInput(f"{where}: node {index} splits on feature {feature} at {threshold}")
            nodes.append((int(feature), float(threshold), first + int(left), first + int(right)))
    return nodes


def _is_connected(tree: TreeParts) -> bool:
    """Whether the root leads to all nodes, each of which is the child of at most one."""
    count, pending = 0, [0]
    while pending:
        node = tree.nodes[pending.pop()]
        count += 1
        if not isinstance(node, int):
            pending += [int(node[2]), int(node[3])]
    return count == len(tree.nodes)


@kernel
def leaf_id_of(trees: Trees, behavior: int, sensed: Floats) -> int:
    """The leaf_id that a behavior answers with.

    Args:
        sensed: what every behavior senses, [n SENSED].
    """
    nodes = trees.nodes
    node = trees.roots[behavior]
    first = behavior * SENSED
    while nodes[node, 0] >= 0.0:
        below = sensed[first + int(nodes[node, 0])] < nodes[node, 1]
        node = int(nodes[node, 2] if below else nodes[node, 3])
    return int(nodes[node, 2])


@kernel
def sense(code: int, state: State, sensed: Floats, at: int) -> None:
    """Writes what a behavior senses of a state to `sensed`, from place `at` on.

    The same as the observation of that name in `fbql_behaviors.core.observation`, except for the last bits.
    """
    robot_x, robot_y, yaw = state[0], state[1], state[2]
    if code == _WALL:
        x, y, _, _, _ = closest_wall(robot_x, robot_y)
    else:
        x, y = state[5], state[6]
    dx, dy = x - robot_x, y - robot_y
    distance = sqrt(dx * dx + dy * dy)
    direction = atan2(dy, dx)
    if code != _APPROACH:
        sensed[at] = distance
        sensed[at + 1] = wrapped(direction - yaw)
        return
    psi = wrapped(atan2(-y, _HALF_LENGTH - x) - direction)
    nearness = DETOUR_RADIUS_M / (distance + 1e-9)
    tangent = asin(nearness) if nearness < 1.0 else pi / 2 * min(nearness, 1.5)
    detour = min(max(DETOUR_GAIN * psi, -tangent), tangent)
    sensed[at] = wrapped(direction - detour - yaw)
    sensed[at + 1] = psi
