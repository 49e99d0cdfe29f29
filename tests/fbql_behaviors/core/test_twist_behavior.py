"""A tree that drives any robot: what it answers, from which messages, and when it answers nothing."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import nan

import pytest
import yaml
from fbql_behaviors.core.bag_spec import recipe_of, spec_of
from fbql_behaviors.core.tree import CommandLeaf, Split, Tree
from fbql_behaviors.core.twist_behavior import TwistBehavior
from fbql_common.core.errors import BadInput
from fbql_common.core.twist import Twist
from robot_bags import SPEC

NS = 10**9
TYPES = {"/scan": "sensor_msgs/msg/LaserScan", "/cmd_vel": "geometry_msgs/msg/Twist"}


@dataclass
class Scan:
    """A message with distances to the right and, from the eighth on, to the left."""

    ranges: list[float] = field(default_factory=list[float])


def scan(right_m: float, left_m: float) -> Scan:
    return Scan([right_m] * 4 + [9.0] * 4 + [left_m] * 4)


def behavior() -> TwistBehavior:
    """Turns left where something is nearer than 1 m to the right."""
    spec = spec_of(yaml.safe_load(SPEC))
    nodes, leaves = (Split(0, 1.0, 1, 2), 0, 1), (CommandLeaf((0.2, 1.0), 3), CommandLeaf((0.8, 0.0), 5))
    return TwistBehavior(Tree("keep_clear", spec.features, nodes, leaves, {}, spec.commands, recipe_of(spec, TYPES)))


def test_the_leaf_of_the_last_message_gives_every_axis_of_the_command() -> None:
    core = behavior()
    assert core.types == {"/scan": TYPES["/scan"]}
    for distances, leaf_id, twist in (
        ((0.5, 3.0), 0, Twist(linear_x_m_s=0.2, angular_z_rad_s=1.0)),
        ((1.0, 0.5), 1, Twist(linear_x_m_s=0.8)),
    ):
        core.hear("/scan", scan(*distances), 0)
        assert core.answer(0) == (twist, leaf_id, False, "")


def test_outside_of_the_root_region_the_leaf_at_its_edge_answers_and_that_is_counted() -> None:
    core = behavior()
    for count, (distances, clamped) in enumerate(
        (((5.0, 3.0), True), ((3.0, 4.0), True), ((3.0, -1.0), True)), start=1
    ):
        core.hear("/scan", scan(*distances), 0)
        assert (core.answer(0).clamped, core.answer(0).leaf_id) == (clamped, 1)
        assert core.clamped_count == 2 * count
    core.hear("/scan", scan(3.0, 3.0), 0)
    assert not core.answer(0).clamped
    assert core.clamped_count == 6


def test_nothing_is_answered_before_the_first_message_after_its_age_or_where_it_is_not_finite() -> None:
    core = behavior()
    assert core.answer(0) == (None, -1, False, "no message on /scan yet")
    core.hear("/scan", scan(3.0, 3.0), NS)
    assert core.answer(NS + 3 * NS // 10).twist == Twist(linear_x_m_s=0.8), "0.3 s old is not too old"
    assert core.answer(NS + 3 * NS // 10 + 1) == (None, -1, False, "/scan older than 0.3 s")
    core.hear("/scan", scan(nan, 3.0), NS)
    assert core.answer(NS).problem == "right_distance not finite"
    assert core.clamped_count == 0


def test_a_message_that_lacks_what_is_read_is_refused_with_its_topic_and_the_last_one_holds() -> None:
    core = behavior()
    core.hear("/scan", scan(3.0, 3.0), 0)
    with pytest.raises(BadInput, match=r"^/scan: field 'ranges"):
        core.hear("/scan", Scan([1.0]), 0)
    with pytest.raises(BadInput, match=r"^/scan: field 'ranges.*does not hold numbers"):
        core.hear("/scan", Scan([[1.0], [2.0]]), 0)  # pyright: ignore[reportArgumentType]
    assert core.answer(0).leaf_id == 1


def test_a_tree_without_a_recipe_is_refused() -> None:
    tree = behavior().tree
    with pytest.raises(BadInput, match="the tree of 'keep_clear' has no recipe of its observations"):
        TwistBehavior(Tree(tree.behavior, tree.features, tree.nodes, tree.leaves, {}, tree.commands))
