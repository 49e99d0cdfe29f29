"""The behaviors in imagination: they sense and answer as the real ones."""

from __future__ import annotations

from math import pi

import numpy as np
import pytest
from fbql_behaviors.core.behavior import Behavior
from fbql_behaviors.shipped import shipped_trees
from fbql_behaviors.storage import load_tree
from fbql_common.core.errors import BadInput
from fbql_common.core.types import World
from fbql_common.core.walls import HALF_WIDTH, SIDE_END, closest_wall_point
from fbql_fusion.core.tasks.soccer.world_model.real_steps import state_of
from fbql_fusion.core.tasks.soccer.world_model.team import SENSED, SENSES, Team, TreeParts, leaf_id_of, sense
from hypothesis import given
from hypothesis import strategies as st

BEHAVIORS = {name: Behavior(name, load_tree(shipped_trees() / f"{name}.json")) for name in SENSES}
TEAM = Team([TreeParts(b.tree.nodes, b.tree.leaves, b.tree.hash) for b in BEHAVIORS.values()], list(BEHAVIORS))
LEAF = TreeParts([0], [(1.0, 2.0)], "hash")


def world_of(robot: tuple[float, float, float], ball: tuple[float, float]) -> World:
    return World(1, 0, 0, *robot, 0.0, 0.0, *ball, 0.0, 0.0, *closest_wall_point(*robot[:2]), *[False] * 6)


worlds = st.builds(
    world_of,
    st.tuples(st.floats(-SIDE_END, SIDE_END), st.floats(-HALF_WIDTH, HALF_WIDTH), st.floats(-pi, pi)),
    st.tuples(st.floats(-1.1, 1.1), st.floats(-HALF_WIDTH, HALF_WIDTH)),
)


@given(worlds)
def test_what_is_sensed_is_what_the_behaviors_sense(world: World) -> None:
    sensed = np.zeros(len(TEAM) * SENSED)
    for i, name in enumerate(BEHAVIORS):
        sense(SENSES[name], state_of(world), sensed, i * SENSED)
    for i, behavior in enumerate(BEHAVIORS.values()):
        for mine, its in zip(sensed[i * SENSED :], behavior.answer(world).observation, strict=False):
            # an angle may be on the other side of the cut
            assert min(abs(mine - its), abs(abs(mine - its) - 2 * pi)) < 1e-9


@given(worlds)
def test_the_leaf_and_its_reference_are_the_behaviors(world: World) -> None:
    outputs = [behavior.answer(world) for behavior in BEHAVIORS.values()]
    sensed = np.array([x for output in outputs for x in output.observation])
    for i, output in enumerate(outputs):
        leaf = leaf_id_of(TEAM.trees, i, sensed)
        assert leaf == output.leaf_id
        assert tuple(TEAM.trees.references[TEAM.trees.first_leaves[i] + leaf]) == output.command


def test_trees_follow_each_other_in_the_arrays() -> None:
    split = TreeParts([(1, 0.5, 1, 2), 1, 0], [(3.0, 4.0), (5.0, 6.0)], "other")
    team = Team([LEAF, split], ["wall_avoiding", "ball_seeking"])
    assert (len(team), team.hashes) == (2, ("hash", "other"))
    assert leaf_id_of(team.trees, 0, np.zeros(4)) == 0
    assert [leaf_id_of(team.trees, 1, np.array([9.0, 9.0, 0.0, x])) for x in (0.4, 0.5)] == [1, 0]
    assert team.trees.references[team.trees.first_leaves[1] + 1].tolist() == [5.0, 6.0]


@pytest.mark.parametrize(
    "nodes",
    [
        [(0, 0.5, 1, 0), 0],  # a circle
        [(0, 0.5, 1, 1), 0],  # a child of two
        [(0, 0.5, 1, 7), 0],  # no such node
        [(2, 0.5, 1, 2), 0, 0],  # no such feature
        [3],  # no such leaf
        [(0, 0.5, 1, 2), 0, 0, (0, 0.1, 1, 2)],  # not reached
        [(0, float("nan"), 1, 2), 0, 0],
    ],
)
def test_what_is_no_tree_is_bad_input(nodes: list[tuple[float, ...] | int]) -> None:
    with pytest.raises(BadInput):
        Team([TreeParts(nodes, [(1.0, 2.0)], "hash")], ["ball_seeking"])
