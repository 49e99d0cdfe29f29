"""The leaf of a source: the nearest level of each axis, whatever it commands."""

from __future__ import annotations

import pytest
from fbql_common.core.command_space import Axis, CommandSpace
from fbql_fusion.core.tasks.twist.answers import SourceLeaves

LEAVES = SourceLeaves(CommandSpace((Axis("linear.x", "m/s", -1.0, 1.0, 5), Axis("angular.z", "rad/s", -2.0, 2.0, 3))))
LARGEST = 1.7976931348623157e308
"""A velocity of this size, too, can come in a message."""


@pytest.mark.parametrize(
    ("command", "level", "turn"),
    [
        ((-1.0, 0.0), 0, 1), ((-0.76, 0.0), 0, 1), ((-0.75, 0.0), 1, 1), ((0.0, -1.01), 2, 0), ((0.0, -1.0), 2, 1),
        ((1.0, 2.0), 4, 2), ((7.0, -9.0), 4, 0), ((LARGEST, -LARGEST), 4, 0), ((-LARGEST, LARGEST), 0, 2),
    ],
)  # fmt: skip
def test_the_leaf_of_a_command_is_its_nearest_level_on_each_axis(
    command: tuple[float, float], level: int, turn: int
) -> None:
    assert LEAVES.leaf(command) == 3 * level + turn


def test_leaves_of_other_axes_have_another_hash() -> None:
    hashes = {
        SourceLeaves(CommandSpace((axis,))).hash
        for axis in (Axis("linear.x", "m/s", -1.0, 1.0, 5), Axis("linear.x", "m/s", -1.0, 1.0, 6))
    }
    assert len(hashes) == 2
    assert LEAVES.answer((0.5, 0.0)).tree_hash == LEAVES.answer(None).tree_hash == LEAVES.hash


def test_a_source_that_may_not_drive_has_a_leaf_of_its_own() -> None:
    assert LEAVES.count == 16
    for answer in (LEAVES.answer(None), LEAVES.answer((0.5, 0.0), active=False)):
        assert (answer.leaf_id, answer.active, answer.command) == (15, False, (0.0, 0.0))
    assert LEAVES.answer((0.5, 0.0)).command == (0.5, 0.0)
