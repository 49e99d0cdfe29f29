"""RL-based decision tree induction (section II.A.1): learning, and exact dynamic programming over the same boxes.

State: a box s(phi). Actions: no split, and a half-split along each feature. A split is offered unless one of the paper's
four stop criteria forbids it: the halves would be narrower than `min_range`; the box holds fewer patterns than
`min_patterns`; a half would hold fewer than `min_half_patterns` (checked per action; by default, none); the entropy is at
most `max_entropy`.

Two objectives (docs/deviations.md): `printed` is eqs. 1-4 as printed. `weighted` multiplies a box's gain by its share of
all patterns and adds the children's values instead of averaging them, so that with discount 1 the value of a tree is the
entropy it removes minus the cost of its splits. Both methods maximise the same values; `dp` does it exactly, `rl` by trials.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from math import floor, log2
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from fbql_common.core.command_space import CommandSpace
from fbql_common.core.parameters import check, parameter

from fbql_behaviors.core.boxes import Boxes, edge, find_boxes
from fbql_behaviors.core.equations import children_value, information_gain, q_update, q_update_printed, split_reward
from fbql_behaviors.core.levels import command_at, levels_at
from fbql_behaviors.core.patterns import Patterns
from fbql_behaviors.core.tree import AnyLeaf, Node, Split, Tree, make_leaf

NO_SPLIT = -1
UNIFORM_BLOCK = 4096


@dataclass(frozen=True)
class InductionParameters:
    """How a tree is induced."""

    method: str = parameter("rl", "how values are found: by trials, or exactly", choices=("rl", "dp"))
    objective: str = parameter("weighted", "what a tree is worth", choices=("printed", "weighted"))
    split_cost: float = parameter(-0.01, "r_split, the reward of splitting itself", unit="nat", low=-10.0, high=0.0)
    discount: float = parameter(1.0, "gamma", low=0.0, high=1.0)
    min_range: float = parameter(1 / 64, "smallest range of a region, as a share of the root's", low=1 / 4096, high=1.0)
    min_patterns: int = parameter(2, "fewest patterns of a region that is split", low=2, high=1_000_000)
    min_half_patterns: int = parameter(
        1, "fewest patterns of each half of a split; 1: neither is empty", low=1, high=1_000_000
    )
    max_entropy: float = parameter(0.0, "entropy up to which a region counts as pure", unit="nat", low=0.0, high=10.0)
    trials: int = parameter(50, "trials of the rl method", low=1, high=1_000_000)
    learning_rate: float = parameter(1.0, "alpha of the rl method", low=0.001, high=1.0)
    optimism: float = parameter(
        0.5, "Q of a split not yet tried, as a share of the entropy that it could remove at once", low=0.0, high=2.0
    )
    epsilon_start: float = parameter(0.05, "share of random actions in the first trial", low=0.0, high=1.0)
    epsilon_end: float = parameter(0.0, "share of random actions in the last trial", low=0.0, high=1.0)
    update: str = parameter(
        "converging", "eq. 4 with the term -Q, or as printed (diverges)", choices=("converging", "printed")
    )


class Option(NamedTuple):
    """A half-split that a box offers: its feature, eq. 3's reward, and the boxes it makes."""

    feature: int
    reward: float
    left: int
    right: int


class Values(NamedTuple):
    """The outcome of a method."""

    split: list[int]
    """The best split of each box, as the feature; NO_SPLIT: a leaf."""
    values: list[float]
    """The value of each box, max Q; the root comes first. Exact with dp, as learned so far with rl."""
    curve: list[float]
    """The root's value after each trial; empty for dp."""

    @property
    def value(self) -> float:
        """The root's value."""
        return self.values[0]


class Induced(NamedTuple):
    """A tree, the value of its root, and the root's value after each trial (empty for dp)."""

    tree: Tree
    value: float
    curve: list[float]


def induce(behavior: str, patterns: Patterns, parameters: InductionParameters, seed: int) -> Induced:
    """Induces a tree from patterns. The rl method draws all its randomness from `seed`.

    Leaves hold the mean command of their patterns' classes, such as wheel velocities [rad/s]. The tree's origin records the parameters and the
    patterns' SHA-256. Raises BadInput for parameters out of range.
    """
    check(parameters, "induction")
    boxes = find_boxes(patterns, (_halvings(parameters.min_range),) * len(patterns.features))
    if parameters.method == "dp":
        values = plan(boxes, parameters)
    else:
        values = learn(boxes, parameters, np.random.default_rng(seed))
    nodes, leaves = _grow(boxes, values.split, patterns)
    origin = {**_origin(parameters), "seed": seed, "patterns": len(patterns), "patterns_sha256": patterns.sha256}
    tree = Tree(behavior, patterns.features, nodes, leaves, origin, patterns.commands)
    return Induced(tree, values.value, values.curve)


def _origin(parameters: InductionParameters) -> dict[str, Any]:
    """The parameters as a tree's origin records them.

    `min_half_patterns` was added later: it is left out where it forbids nothing, so that the hashes of older trees hold.
    """
    origin = asdict(parameters)
    if parameters.min_half_patterns == 1:
        del origin["min_half_patterns"]
    return origin


def plan(boxes: Boxes, parameters: InductionParameters) -> Values:
    """Exact dynamic programming: from the finest grid to the root, V = max(0, R + gamma * successors)."""
    reward, offered = split_rewards(boxes, parameters)
    share = children_share(parameters)
    value = np.zeros(len(boxes))
    best = np.full(len(boxes), NO_SPLIT)
    for begin, end in reversed(boxes.grids):
        left, right = boxes.left[begin:end], boxes.right[begin:end]
        target = reward[begin:end] + parameters.discount * children_value(value[left], value[right], share)
        target = np.where(offered[begin:end], target, -np.inf)
        feature = target.argmax(axis=1)
        highest = target[np.arange(end - begin), feature]
        best[begin:end] = np.where(highest > 0.0, feature, NO_SPLIT)
        value[begin:end] = np.maximum(highest, 0.0)
    return Values(best.tolist(), value.tolist(), [])


def learn(boxes: Boxes, parameters: InductionParameters, rng: np.random.Generator) -> Values:
    """Q-learning by trials: each grows a tree from the root by epsilon-greedy actions and updates Q by eq. 4.

    A trial's updates run from the last box it visited back to the root, so that a box learns from its children's newest
    values. The no-split action is terminal and earns 0, so its Q stays 0. Initial values are optimistic (Sutton and Barto
    2018, section 2.6): an untried split is worth a share of the entropy left to remove, so that trials explore where there
    is something to gain.
    """
    reward, offered = split_rewards(boxes, parameters)
    options = _options(boxes, reward, offered)
    initial = (parameters.optimism * boxes.entropy * gain_weight(boxes, parameters)).tolist()
    q = [[value] * len(available) for value, available in zip(initial, options, strict=True)]
    best = [max(0.0, *values) if values else 0.0 for values in q]
    update = q_update if parameters.update == "converging" else q_update_printed
    share, discount, alpha = children_share(parameters), parameters.discount, parameters.learning_rate
    uniform = _uniforms(rng)
    curve: list[float] = []
    for trial in range(parameters.trials):
        epsilon = _epsilon(parameters, trial)
        visited: list[tuple[int, int]] = []
        pending = [0]
        while pending:
            box = pending.pop()
            available = options[box]
            if not available:
                continue
            draw = next(uniform)
            action = _any_action(draw / epsilon, len(available)) if draw < epsilon else _greedy(q[box])
            if action == NO_SPLIT:
                continue
            visited.append((box, action))
            option = available[action]
            pending.append(option.right)
            pending.append(option.left)
        for box, action in reversed(visited):
            _, gain, left, right = options[box][action]
            values = q[box]
            target = gain + discount * children_value(best[left], best[right], share)
            values[action] = update(values[action], target, alpha)
            best[box] = max(0.0, *values)
        curve.append(best[0])
    greedy = [_greedy(values) for values in q]
    split = [options[box][action].feature if action != NO_SPLIT else NO_SPLIT for box, action in enumerate(greedy)]
    return Values(split, best, curve)


def split_rewards(
    boxes: Boxes, parameters: InductionParameters
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.bool_]]:
    """Eq. 3's reward of every half-split, and whether it is offered: both [b, d]; 0 where it is not."""
    left, right = boxes.left, boxes.right
    allowed = (boxes.count >= parameters.min_patterns) & (boxes.entropy > parameters.max_entropy)
    count = boxes.count.astype(np.float64)
    n_left, n_right = count[left], count[right]
    enough = np.minimum(n_left, n_right) >= parameters.min_half_patterns
    offered = (left >= 0) & (right >= 0) & enough & allowed[:, None]
    gain = information_gain(boxes.entropy[:, None], boxes.entropy[left], boxes.entropy[right], n_left, n_right)
    gain = gain * gain_weight(boxes, parameters)[:, None]
    reward = split_reward(parameters.split_cost, np.round(gain, 12))
    return np.where(offered, reward, 0.0), offered


def gain_weight(boxes: Boxes, parameters: InductionParameters) -> npt.NDArray[np.float64]:
    """The weight of each box's gain [b]: 1 as printed, or the box's share of all patterns."""
    if parameters.objective == "printed":
        return np.ones(len(boxes))
    return boxes.count / boxes.count[0]


def children_share(parameters: InductionParameters) -> float:
    """The weight of the children's values: a half each as printed, 1 with the weighted objective."""
    return 0.5 if parameters.objective == "printed" else 1.0


def _halvings(min_range: float) -> int:
    return floor(log2(1.0 / min_range) + 1e-9)


def _options(boxes: Boxes, reward: npt.NDArray[np.float64], offered: npt.NDArray[np.bool_]) -> list[list[Option]]:
    options: list[list[Option]] = [[] for _ in range(len(boxes))]
    rows, columns = np.nonzero(offered)
    for box, feature, value, left, right in zip(
        rows.tolist(),
        columns.tolist(),
        reward[rows, columns].tolist(),
        boxes.left[rows, columns].tolist(),
        boxes.right[rows, columns].tolist(),
        strict=True,
    ):
        options[box].append(Option(feature, value, left, right))
    return options


def _uniforms(rng: np.random.Generator) -> Iterator[float]:
    while True:
        yield from rng.random(UNIFORM_BLOCK).tolist()


def _epsilon(parameters: InductionParameters, trial: int) -> float:
    """The share of random actions, falling linearly over the trials."""
    progress = trial / max(parameters.trials - 1, 1)
    return parameters.epsilon_start + (parameters.epsilon_end - parameters.epsilon_start) * progress


def _any_action(draw: float, splits: int) -> int:
    """NO_SPLIT or one of the splits, from a uniform draw in [0, 1]."""
    return min(int(draw * (splits + 1)), splits) - 1


def _greedy(values: list[float]) -> int:
    """The best action by Q; NO_SPLIT, whose Q is 0, unless a split is worth more. Ties: the first feature."""
    highest = max(values, default=0.0)
    return values.index(highest) if highest > 0.0 else NO_SPLIT


def _grow(boxes: Boxes, split: list[int], patterns: Patterns) -> tuple[tuple[Node, ...], tuple[AnyLeaf, ...]]:
    """The tree that follows the best splits from the root, depth first; leaves take the mean of their patterns."""
    levels = levels_at(patterns.commands, patterns.wheel_class)
    nodes: list[Node] = []
    leaves: list[AnyLeaf] = []

    def grow(box: int, rows: npt.NDArray[np.int64]) -> int:
        place = len(nodes)
        column = split[box]
        if column == NO_SPLIT:
            nodes.append(len(leaves))
            leaves.append(_leaf(patterns.commands, levels[rows]))
            return place
        feature = patterns.features[column]
        halves = 2 << int(boxes.levels[box, column])
        middle = (2 * int(boxes.index[box, column]) + 1) / halves
        threshold = edge(feature.low, feature.high, middle)
        goes_left = patterns.x[rows, column] < threshold
        nodes.append(0)  # reserves the place before its children
        left = grow(int(boxes.left[box, column]), rows[goes_left])
        right = grow(int(boxes.right[box, column]), rows[~goes_left])
        nodes[place] = Split(column, threshold, left, right)
        return place

    grow(0, np.arange(len(patterns)))
    return tuple(nodes), tuple(leaves)


def _leaf(space: CommandSpace, levels: npt.NDArray[np.int64]) -> AnyLeaf:
    """The mean of the levels [n, axes] of a leaf's patterns; sums of integers, so the same everywhere."""
    command = command_at(space, [total / len(levels) for total in levels.sum(axis=0).tolist()])
    return make_leaf(space, command, len(levels))
