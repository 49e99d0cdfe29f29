"""A decision tree: splits of a root region into leaves, each leaf with the command of its behavior.

Regions are half-open boxes: a point on a split belongs to the right child. A `Tree` is immutable data, checked when it is
made; `origin` records how it was induced. A command is a pair of wheel velocities, unless the tree has another command space.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import nextafter
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from fbql_common.core.command_space import Command, CommandSpace
from fbql_common.core.errors import BadInput
from fbql_common.core.field import WHEELS

from fbql_behaviors.core.observation import Feature

MAX_NODES = 1_000_000
MAX_FEATURES = 64
"""Checking a tree takes time and memory by its nodes times its features."""
MAX_FEATURE = 1e12
"""Largest bound of a feature or command: what is computed with it stays finite."""
MAX_AXES = 6
MAX_LEVELS = 1001
CHANGED = "changed"
"""The method in the origin of a tree whose leaves were changed one by one."""


class Split(NamedTuple):
    """An inner node: observations with observation[feature] < threshold go to node `left`, the others to `right`."""

    feature: int
    threshold: float
    left: int
    right: int


class Leaf(NamedTuple):
    """The reference of a leaf, and the number of patterns it was made from."""

    left_rad_s: float
    right_rad_s: float
    patterns: int

    @property
    def command(self) -> Command:
        """The reference as a command in `field.WHEELS`."""
        return self[:2]


class CommandLeaf(NamedTuple):
    """The reference of a leaf in a command space that is not `field.WHEELS`, and the number of patterns."""

    command: Command
    patterns: int


AnyLeaf = Leaf | CommandLeaf

Node = Split | int
"""A split, or the leaf_id of a leaf."""

Region = tuple[tuple[float, float], ...]
"""A half-open box: (low, high) of each feature."""


@dataclass(frozen=True)
class Tree:
    """A behavior's tree.

    behavior: name of the behavior.
    features: the parts of the observation, in order, with the root region.
    nodes: node 0 is the root; every other node is the child of exactly one split.
    leaves: indexed by leaf_id, dense from 0; every leaf_id occurs in exactly one node. `Leaf` in WHEELS, else `CommandLeaf`.
    origin: how the tree was made (method, parameters, SHA-256 of the training data ...); JSON values only.
    commands: the command space of the leaves.
    recipe: how its features are read from messages (`core.bag_spec`), JSON values only; empty for observations in code.

    Raises BadInput when any of this does not hold.
    """

    behavior: str
    features: tuple[Feature, ...]
    nodes: tuple[Node, ...]
    leaves: tuple[AnyLeaf, ...]
    origin: Mapping[str, Any] = field(default_factory=dict[str, Any])
    commands: CommandSpace = WHEELS
    recipe: Mapping[str, Any] = field(default_factory=dict[str, Any])
    hash: str = field(init=False)
    """SHA-256 of the tree's whole content, 64 hexadecimal digits: the same in the file and in every process."""
    contains: Callable[[Sequence[float]], bool] = field(init=False, repr=False, compare=False)
    """Whether an observation [d] is inside the root region; False for NaN."""
    _root: tuple[Any, Any, Any, Any] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        check_features(self.features)
        check_space(self.commands)
        _check_leaves(self.leaves, self.commands)
        order = _check_nodes(self)
        object.__setattr__(self, "_root", _nested(self, order))
        object.__setattr__(self, "contains", _contains(tuple((feature.low, feature.high) for feature in self.features)))
        object.__setattr__(self, "hash", hashlib.sha256(canonical(self.content()).encode()).hexdigest())

    def __reduce__(self) -> tuple[type[Tree], tuple[object, ...]]:
        """A copy is made from the content; what is compiled from it is not copied."""
        content = (self.behavior, self.features, self.nodes, self.leaves, dict(self.origin))
        return Tree, (*content, self.commands, dict(self.recipe))

    @property
    def leaf_count(self) -> int:
        return len(self.leaves)

    @property
    def wheel_leaves(self) -> tuple[Leaf, ...]:
        """The leaves of a tree that commands wheels. Raises BadInput for any other."""
        leaves = tuple(leaf for leaf in self.leaves if isinstance(leaf, Leaf))
        if len(leaves) < len(self.leaves):
            axes = ", ".join(axis.name for axis in self.commands.axes)
            raise BadInput(f"the tree of '{self.behavior}' commands {axes}, not wheels; twist_behavior plays it")
        return leaves

    def answer(self, observation: Sequence[float]) -> tuple[int, *tuple[float, ...]]:
        """leaf_id and command of an observation [d]; outside the root region, of the leaf at its edge.

        In WHEELS: leaf_id, left and right reference [rad/s].
        """
        feature, threshold, left, right = self._root
        while feature >= 0:
            feature, threshold, left, right = left if observation[feature] < threshold else right
        return threshold

    def clamp(self, observation: Sequence[float]) -> tuple[float, ...]:
        """The observation moved into the root region: below `low` to `low`, from `high` on to the last float below it."""
        return tuple(
            min(max(value, feature.low), nextafter(feature.high, feature.low))
            for value, feature in zip(observation, self.features, strict=True)
        )

    def leaf_ids(self, x: npt.NDArray[np.float64]) -> npt.NDArray[np.int64]:
        """The leaf_id of many observations: [n, d] -> [n]."""
        leaf_ids = np.empty(len(x), np.int64)
        pending = [(0, np.arange(len(x)))]
        while pending:
            index, rows = pending.pop()
            node = self.nodes[index]
            if isinstance(node, Split):
                goes_left = x[rows, node.feature] < node.threshold
                pending += [(node.left, rows[goes_left]), (node.right, rows[~goes_left])]
            else:
                leaf_ids[rows] = node
        return leaf_ids

    def references(self, x: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """The commands of many observations: [n, d] -> [n, axes]; in WHEELS [rad/s], columns left and right."""
        table = np.array([leaf.command for leaf in self.leaves])
        return table[self.leaf_ids(x)]

    def regions(self) -> tuple[Region, ...]:
        """The region of every leaf, indexed by leaf_id; together they tile the root region."""
        regions: list[Region] = [()] * len(self.leaves)
        pending: list[tuple[int, Region]] = [(0, tuple((f.low, f.high) for f in self.features))]
        while pending:
            index, region = pending.pop()
            node = self.nodes[index]
            if isinstance(node, Split):
                left, right = split_region(region, node.feature, node.threshold)
                pending += [(node.left, left), (node.right, right)]
            else:
                regions[node] = region
        return tuple(regions)

    def content(self) -> dict[str, Any]:
        """The whole tree as JSON values; the hash is computed over it. The wheels' command space is left out."""
        content: dict[str, Any] = {
            "behavior": self.behavior,
            "features": [feature._asdict() for feature in self.features],
            "nodes": [list(node) if isinstance(node, Split) else node for node in self.nodes],
            "leaves": [leaf._asdict() for leaf in self.leaves],
            "origin": dict(self.origin),
        }
        if self.commands != WHEELS:
            content["commands"] = [axis._asdict() for axis in self.commands.axes]
        if self.recipe:
            content["recipe"] = dict(self.recipe)
        return content


def split_region(region: Region, feature: int, threshold: float) -> tuple[Region, Region]:
    """The two half-open regions that a split makes; the threshold itself is in the right one."""
    low, high = region[feature]
    before, after = region[:feature], region[feature + 1 :]
    return (*before, (low, threshold), *after), (*before, (threshold, high), *after)


def _contains(region: Region) -> Callable[[Sequence[float]], bool]:
    """Whether a point is inside a region. Two chained comparisons take a fifth of the time of a loop."""
    if len(region) == 2:
        (low, high), (other_low, other_high) = region
        return lambda point: low <= point[0] < high and other_low <= point[1] < other_high
    return lambda point: all(low <= value < high for value, (low, high) in zip(point, region, strict=True))


def canonical(content: Any) -> str:
    """Canonical JSON: sorted keys, no spaces, the shortest floats that read back the same."""
    return json.dumps(content, sort_keys=True, separators=(",", ":"), allow_nan=False)


def check_features(features: tuple[Feature, ...]) -> None:
    """Raises BadInput unless the features have different names, and finite limits in order."""
    if not features:
        raise BadInput("a tree needs at least one feature")
    if len(features) > MAX_FEATURES:
        raise BadInput(f"{len(features)} features; at most {MAX_FEATURES} are supported")
    names = [feature.name for feature in features]
    for name in names:
        if names.count(name) > 1:
            raise BadInput(f"feature '{name}' occurs twice")
    for feature in features:
        if not -MAX_FEATURE <= feature.low < feature.high <= MAX_FEATURE:
            raise BadInput(
                f"feature '{feature.name}': low {feature.low} must be below high {feature.high}, both within "
                f"+-{MAX_FEATURE:g}"
            )


def make_leaf(space: CommandSpace, command: Command, patterns: int) -> AnyLeaf:
    """The leaf of a command, of the kind that its command space needs."""
    return Leaf(command[0], command[1], patterns) if space == WHEELS else CommandLeaf(command, patterns)


def changed_leaf(tree: Tree, leaf_id: int, command: Command) -> Tree:
    """The tree with another command in one leaf; its origin names the tree that it was before the first such change.

    Raises BadInput for a command out of range.
    """
    leaves = list(tree.leaves)
    leaves[leaf_id] = make_leaf(tree.commands, command, leaves[leaf_id].patterns)
    origin: dict[str, Any] = {"changed_from": tree.hash, "changed_from_origin": dict(tree.origin)}
    numbers: list[Any] = []
    if tree.origin.get("method") == CHANGED:
        origin = dict(tree.origin)
        earlier: Any = origin.get("changed_leaves")
        numbers = list(earlier) if isinstance(earlier, list) else []  # pyright: ignore[reportUnknownArgumentType]
    origin |= {"method": CHANGED, "changed_leaves": [*numbers, leaf_id]}
    return replace(tree, leaves=tuple(leaves), origin=origin)


def check_space(space: CommandSpace) -> None:
    """Raises BadInput unless the axes have different names, finite limits in order, and 2 levels or more."""
    names = [axis.name for axis in space.axes]
    if not 0 < len(names) <= MAX_AXES or len(set(names)) < len(names):
        raise BadInput(f"a command needs 1 to {MAX_AXES} axes, with different names, not {', '.join(names)}")
    for axis in space.axes:
        if not -MAX_FEATURE <= axis.low < axis.high <= MAX_FEATURE:
            raise BadInput(
                f"command axis '{axis.name}': low {axis.low} must be below high {axis.high}, both within +-{MAX_FEATURE:g}"
            )
        if not 2 <= axis.levels <= MAX_LEVELS:
            raise BadInput(f"command axis '{axis.name}': {axis.levels} levels; expected 2 to {MAX_LEVELS}")


def _check_leaves(leaves: tuple[AnyLeaf, ...], space: CommandSpace) -> None:
    if not leaves:
        raise BadInput("a tree needs at least one leaf")
    for leaf_id, leaf in enumerate(leaves):
        if isinstance(leaf, Leaf) != (space == WHEELS) or len(leaf.command) != len(space.axes):
            raise BadInput(f"leaf {leaf_id}: its command is not one of {', '.join(axis.name for axis in space.axes)}")
        for axis, value in zip(space.axes, leaf.command, strict=True):
            if not axis.low <= value <= axis.high:
                name = f"{axis.name}_rad_s" if space == WHEELS else axis.name
                limits = f"+-{axis.high:g}" if axis.low == -axis.high else f"[{axis.low:g}, {axis.high:g}]"
                raise BadInput(f"leaf {leaf_id}: {name} is {value}, outside of {limits} {axis.unit}".rstrip())
        if leaf.patterns < 0:
            raise BadInput(f"leaf {leaf_id}: patterns is {leaf.patterns}, below 0")


def _check_nodes(tree: Tree) -> list[int]:
    """Walks the tree from its root. Returns the nodes visited, parents before children."""
    if len(tree.nodes) > MAX_NODES:
        raise BadInput(f"{len(tree.nodes)} nodes; at most {MAX_NODES} are supported")
    if not tree.nodes:
        raise BadInput("a tree needs at least one node")
    visited = [False] * len(tree.nodes)
    leaf_seen = [False] * len(tree.leaves)
    order: list[int] = []
    pending: list[tuple[int, Region]] = [(0, tuple((f.low, f.high) for f in tree.features))]
    while pending:
        index, region = pending.pop()
        if not 0 <= index < len(tree.nodes):
            raise BadInput(f"child index {index} is outside of 0 .. {len(tree.nodes) - 1}")
        if visited[index]:
            raise BadInput(f"node {index} is reached twice: a cycle, or two parents")
        visited[index] = True
        order.append(index)
        node = tree.nodes[index]
        if isinstance(node, Split):
            if not 0 <= node.feature < len(tree.features):
                raise BadInput(f"node {index}: feature {node.feature} is outside of 0 .. {len(tree.features) - 1}")
            low, high = region[node.feature]
            if not low < node.threshold < high:
                raise BadInput(f"node {index}: threshold {node.threshold} is not inside of its region ({low}, {high})")
            left, right = split_region(region, node.feature, node.threshold)
            pending += [(node.right, right), (node.left, left)]
        else:
            if not 0 <= node < len(tree.leaves):
                raise BadInput(f"node {index}: leaf_id {node} is outside of 0 .. {len(tree.leaves) - 1}")
            if leaf_seen[node]:
                raise BadInput(f"node {index}: leaf_id {node} appears in two nodes")
            leaf_seen[node] = True
    if len(order) < len(tree.nodes):
        raise BadInput(f"node {visited.index(False)} is not reached from the root")
    if not all(leaf_seen):
        raise BadInput(f"leaf_id {leaf_seen.index(False)} appears in no node")
    return order


def _nested(tree: Tree, order: list[int]) -> Any:
    """The tree as nested tuples, the fastest structure to walk in plain Python.

    A split is (feature, threshold, left tuple, right tuple), a leaf (-1, (leaf_id, *command), None, None).
    """
    nested: list[Any] = [None] * len(tree.nodes)
    for index in reversed(order):
        node = tree.nodes[index]
        if isinstance(node, Split):
            nested[index] = (node.feature, node.threshold, nested[node.left], nested[node.right])
        else:
            nested[index] = (-1, (node, *tree.leaves[node].command), None, None)
    return nested[0]
