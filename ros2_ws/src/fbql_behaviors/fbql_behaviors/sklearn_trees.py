"""Converts scikit-learn's trees to ours: from a fitted estimator, or from its arrays as JSON. Nothing is unpickled.

scikit-learn need not be installed: only an estimator's arrays are used, as plain lists of numbers.

    {"children_left": [1, -1, -1], "children_right": [2, -1, -1], "feature": [0, -2, -2], "threshold": [0.4, -2, -2],
     "value": [[12.5, 50.0], ...], "n_node_samples": [8, 5, 3]}

`value` holds the left and the right wheel velocity of each node [rad/s], in any nesting, such as `tree_.value.tolist()`.
For a classifier it holds a weight for each class, and `classes` lists the wheel classes; the heaviest class wins.

scikit-learn rounds an attribute to single precision and sends it left when it is at most the threshold; we compare doubles
and send it left when it is below. `exact_threshold` finds the double for which both decide alike for every number.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import inf, isfinite, nextafter
from typing import Any, NamedTuple

import numpy as np
from fbql_common.core.command_space import Command, CommandSpace
from fbql_common.core.errors import BadInput
from fbql_common.core.field import WHEELS

from fbql_behaviors.core.levels import command_at
from fbql_behaviors.core.observation import Feature
from fbql_behaviors.core.quantizer import CLASS_COUNT, levels_of, rad_s_of
from fbql_behaviors.core.tree import MAX_NODES, AnyLeaf, Node, Region, Split, Tree, make_leaf, split_region

ARRAYS = ("children_left", "children_right", "feature", "threshold", "value", "n_node_samples")
NO_CHILD = -1


class _Arrays(NamedTuple):
    left: list[int]
    right: list[int]
    feature: list[int]
    threshold: list[float]
    reference: list[Command]
    """The command of each node, such as wheel velocities [rad/s]."""
    patterns: list[int]


def from_sklearn(
    estimator: Any,
    behavior: str,
    features: tuple[Feature, ...],
    origin: Mapping[str, Any] | None = None,
    scale_rad_s: float = 1.0,
    commands: CommandSpace = WHEELS,
) -> Tree:
    """Our tree of a fitted DecisionTreeRegressor of both wheels, or DecisionTreeClassifier of the wheel class.

    It answers like the estimator's `predict` inside the root region, and outside it like the region's edge.

    Args:
        estimator: fitted on attributes in the order of `features`.
        origin: how the tree was made, for its file.
        scale_rad_s: unit of a regressor's prediction [rad/s]: 1 for rad/s, LEVEL_RAD_S for levels.
        commands: another command space than the wheels'; then the prediction is in its levels.

    Raises BadInput when it is not fitted, or does not predict a wheel pair from so many features.
    """
    fitted = getattr(estimator, "tree_", None)
    if fitted is None:
        raise BadInput(
            f"{type(estimator).__name__}: not a fitted decision tree of scikit-learn; call fit, and give one tree"
        )
    if fitted.n_features != len(features):
        raise BadInput(f"the scikit-learn tree has {fitted.n_features} features; behavior '{behavior}' {len(features)}")
    arrays = {name: getattr(fitted, name).tolist() for name in ARRAYS}
    classes = getattr(estimator, "classes_", None)
    if classes is not None:
        arrays["classes"] = [each.tolist() for each in classes] if fitted.n_outputs > 1 else classes.tolist()
    return from_arrays(arrays, behavior, features, origin, scale_rad_s, commands)


def from_arrays(
    arrays: Mapping[str, Any],
    behavior: str,
    features: tuple[Feature, ...],
    origin: Mapping[str, Any] | None = None,
    scale_rad_s: float = 1.0,
    commands: CommandSpace = WHEELS,
) -> Tree:
    """Our tree of a scikit-learn tree's arrays (see the module docstring). Raises BadInput naming array and node."""
    checked = _check(arrays, scale_rad_s, commands)
    nodes: list[Node] = []
    leaves: list[AnyLeaf] = []
    root = tuple((feature.low, feature.high) for feature in features)
    # (their node, its region, our split above it, whether it is that split's left child)
    pending: list[tuple[int, Region, int, bool]] = [(0, root, -1, False)]
    visited = [False] * len(checked.left)
    while pending:
        index, region, parent, is_left = pending.pop()
        while True:
            if visited[index]:
                raise BadInput(f"children_left, children_right: node {index} is reached twice; this is not a tree")
            visited[index] = True
            if checked.left[index] == NO_CHILD:
                node: Node = len(leaves)
                leaves.append(make_leaf(commands, checked.reference[index], checked.patterns[index]))
                break
            column = checked.feature[index]
            if not 0 <= column < len(features):
                raise BadInput(f"feature[{index}] is {column}, outside of 0 .. {len(features) - 1}")
            threshold = exact_threshold(checked.threshold[index])
            low, high = region[column]
            if low < threshold < high:
                left, right = split_region(region, column, threshold)
                pending.append((checked.right[index], right, len(nodes), False))
                pending.append((checked.left[index], left, len(nodes), True))
                node = Split(column, threshold, 0, 0)
                break
            # The whole region lies on one side: the other child is unreachable.
            index = checked.right[index] if threshold <= low else checked.left[index]
        if parent >= 0:
            above = nodes[parent]
            assert isinstance(above, Split)
            nodes[parent] = above._replace(**{"left" if is_left else "right": len(nodes)})
        nodes.append(node)
    return Tree(behavior, features, tuple(nodes), tuple(leaves), origin or {}, commands)


def exact_threshold(threshold: float) -> float:
    """The double t for which x < t equals float32(x) <= threshold, for every x in the range of single precision."""
    with np.errstate(over="ignore"):
        below = np.float32(threshold)
        if float(below) > threshold:
            below = np.nextafter(below, np.float32(-inf))
        above = np.nextafter(below, np.float32(inf))
        middle = (float(below) + float(above)) / 2
        # A double halfway between two singles rounds to the even one.
        return nextafter(middle, inf) if float(np.float32(middle)) == float(below) else middle


def _check(arrays: Mapping[str, Any], scale_rad_s: float, commands: CommandSpace) -> _Arrays:
    for name in ARRAYS:
        if not isinstance(arrays.get(name), list):
            raise BadInput(f"'{name}' is missing, or not a list; needed are: {', '.join(ARRAYS)}")
    count = len(arrays["children_left"])
    if not 0 < count <= MAX_NODES:
        raise BadInput(f"children_left has {count} nodes; expected 1 to {MAX_NODES}")
    for name in ARRAYS:
        if len(arrays[name]) != count:
            raise BadInput(f"'{name}' has {len(arrays[name])} entries, children_left has {count}")
    left, right = ([_whole(name, k, value) for k, value in enumerate(arrays[name])] for name in ARRAYS[:2])
    for index, (first, second) in enumerate(zip(left, right, strict=True)):
        if (first == NO_CHILD) != (second == NO_CHILD):
            raise BadInput(f"node {index} has one child; expected two, or -1 twice")
        if first != NO_CHILD and not (0 <= first < count and 0 <= second < count):
            raise BadInput(f"node {index}: a child is outside of 0 .. {count - 1}")
    classes = _classes(arrays)
    values = [_flat(index, value) for index, value in enumerate(arrays["value"])]
    references = [
        _class_reference(index, numbers, classes) if classes else _reference(index, numbers, scale_rad_s, commands)
        for index, numbers in enumerate(values)
    ]
    return _Arrays(
        left,
        right,
        [_whole("feature", k, value) for k, value in enumerate(arrays["feature"])],
        [_finite("threshold", k, value) for k, value in enumerate(arrays["threshold"])],
        references,
        [_whole("n_node_samples", k, value) for k, value in enumerate(arrays["n_node_samples"])],
    )


def _reference(index: int, values: list[float], scale_rad_s: float, commands: CommandSpace) -> Command:
    if commands != WHEELS:
        if len(values) != len(commands.axes):
            raise BadInput(f"value[{index}] has {len(values)} numbers; expected one per axis, {len(commands.axes)}")
        return command_at(commands, values)
    if len(values) != 2:
        raise BadInput(f"value[{index}] has {len(values)} numbers; a regressor of both wheels has 2, left and right")
    return values[0] * scale_rad_s, values[1] * scale_rad_s


def _class_reference(index: int, weights: list[float], classes: list[int]) -> Command:
    if len(weights) != len(classes):
        raise BadInput(f"value[{index}] has {len(weights)} weights for {len(classes)} classes")
    left, right = levels_of(classes[weights.index(max(weights))])
    return rad_s_of(left), rad_s_of(right)


def _classes(arrays: Mapping[str, Any]) -> list[int]:
    """The wheel classes of a classifier; empty for a regressor."""
    if "classes" not in arrays:
        return []
    given: Any = arrays["classes"]
    if not isinstance(given, list) or not given:
        raise BadInput("'classes' must be a list of wheel classes")
    classes = [_whole("classes", k, value) for k, value in enumerate(given)]  # pyright: ignore[reportUnknownVariableType, reportUnknownArgumentType]
    if not all(0 <= each < CLASS_COUNT for each in classes):
        raise BadInput(f"'classes' must list wheel classes, from 0 to {CLASS_COUNT - 1}")
    return classes


def _flat(index: int, value: Any) -> list[float]:
    """The numbers of a value, out of any nesting of lists."""
    numbers: list[float] = []
    pending = [value]
    while pending:
        item = pending.pop()
        if isinstance(item, list):
            pending += reversed(item)  # pyright: ignore[reportUnknownArgumentType]
        else:
            numbers.append(_finite("value", index, item))
    return numbers


def _whole(name: str, index: int, value: Any) -> int:
    if type(value) is not int:
        raise BadInput(f"{name}[{index}] is {value!r}, not a whole number")
    return value


def _finite(name: str, index: int, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not isfinite(value):
        raise BadInput(f"{name}[{index}] is {value!r}, not a finite number")
    return float(value)
