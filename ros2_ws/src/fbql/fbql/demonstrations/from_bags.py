"""A tree for any robot from bags: what to induce it from, and how."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

from fbql_behaviors.bag_reading import read_bag
from fbql_behaviors.core.bag_patterns import BagPatterns, patterns_of_bags
from fbql_behaviors.core.bag_spec import Spec, recipe_of
from fbql_behaviors.core.boxes import MAX_GRIDS, MAX_HALVINGS
from fbql_behaviors.core.induction import InductionParameters
from fbql_behaviors.core.observation import OBSERVATIONS
from fbql_behaviors.core.patterns import MAX_PATTERNS
from fbql_behaviors.core.recipes import Recipe
from fbql_common.core.errors import BadInput

from fbql.demonstrations.make_tree import InductionRequest, request_of

FINEST_HALVINGS = 6
"""Halvings of a feature's range if there are few features: regions of a 64th, as for the shipped trees."""
MOST_FEATURES = 10
"""The most observations of a tree: with more, even one halving of each makes a table that takes minutes."""
MOST_BOXES = 200_000
"""Boxes up to which an induction takes about a second."""
_NAME = re.compile(r"[A-Za-z][\w-]{0,99}\Z", re.ASCII)


class BagData(NamedTuple):
    """The data that a tree is induced from."""

    read: BagPatterns
    recipe: dict[str, Any]
    """The recipe of the observations, for the tree file."""


def data_of_bags(paths: Sequence[Path], spec: Spec, every: int, count: int | None) -> BagData:
    """The patterns of bags. Raises BadInput."""
    bags = [read_bag(path, spec) for path in paths]
    for path, bag in zip(paths, bags, strict=True):
        for topic in spec.topics:
            if bag.types[topic] != bags[0].types[topic]:
                raise BadInput(
                    f"{path}: topic {topic} is of type {bag.types[topic]}, in {paths[0]} of {bags[0].types[topic]}"
                )
    where = paths[0] if len(paths) == 1 else f"{len(paths)} bags"
    try:
        read = patterns_of_bags(spec, [bag.events for bag in bags], every, count)
    except BadInput as error:
        raise BadInput(f"{where}: {error}") from None
    return BagData(read, recipe_of(spec, bags[0].types))


def bag_request(name: str, features: int, rows: int = 1, **given: Any) -> InductionRequest:
    """The request for a tree from bags: as `request_of`, with every command as a pattern, and regions as fine as so many
    features and patterns (`rows`) allow. Raises BadInput.
    """
    if name in OBSERVATIONS or not _NAME.match(name):
        raise BadInput(
            f"'{name}' can't be the name of a tree from a bag; choose letters, digits, - and _, and not one of: "
            f"{', '.join(OBSERVATIONS)}"
        )
    if features > MOST_FEATURES:
        raise BadInput(f"{features} observations; at most {MOST_FEATURES} are supported, choose those that matter")
    induction = replace(InductionParameters(), min_range=2.0 ** -halvings_for(features, rows))
    return request_of(name, Recipe(induction, induction, every=1, patterns=MAX_PATTERNS), **given)


def halvings_for(features: int, rows: int) -> int:
    """How often the range of each of this many features can be halved without making the table of boxes too large; at least 1."""
    for halvings in range(FINEST_HALVINGS, 1, -1):
        small = (halvings + 1) ** features <= MAX_GRIDS and features * halvings <= MAX_HALVINGS
        if small and most_boxes(features, halvings, rows) <= MOST_BOXES:
            return halvings
    return 1


def most_boxes(features: int, halvings: int, rows: int) -> int:
    """The most boxes that this many patterns can fill: in each grid no more than its cells, and no more than the patterns."""
    grids = [1]  # by the halvings of all features together, how many grids there are
    for _ in range(features):
        longer = [0] * (len(grids) + halvings)
        for total, number in enumerate(grids):
            for more in range(halvings + 1):
                longer[total + more] += number
        grids = longer
    return sum(number * min(rows, 2**total) for total, number in enumerate(grids))
