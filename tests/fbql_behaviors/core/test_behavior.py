"""A behavior at work."""

from __future__ import annotations

import copy
import pickle
from math import nan

import pytest
from fbql_behaviors.core.behavior import Behavior
from fbql_behaviors.core.observation import OBSERVATIONS, Feature, Observation
from fbql_behaviors.core.tree import Leaf, Split, Tree
from fbql_common.core.errors import BadInput
from fbql_common.core.types import BehaviorOutput, World

FEATURES = OBSERVATIONS["ball_seeking"].features
TREE = Tree("ball_seeking", FEATURES, (Split(0, 0.4, 1, 2), 0, 1), (Leaf(1.0, 2.0, 5), Leaf(3.0, 4.0, 6)))
WORLD = World(170, 3, 12, 0.0, 0.0, 0.0, 0.1, 0.2, 0.5, 0.0, 0.0, 0.0, 0.0, 0.9, 0.0, *[False] * 6)


def test_it_answers_with_the_reference_of_the_leaf_for_the_same_step() -> None:
    assert Behavior("seek", TREE).answer(WORLD) == BehaviorOutput(
        170, 3, 12, "seek", 3.0, 4.0, 1, 2, TREE.hash, False, (0.5, 0.0)
    )


def test_the_same_world_state_gets_the_same_answer() -> None:
    behavior = Behavior("seek", TREE)
    assert behavior.answer(WORLD) == behavior.answer(WORLD)


def test_outside_of_the_root_region_the_answer_is_flagged_and_counted() -> None:
    """Fault 41."""
    behavior = Behavior("seek", TREE)
    output = behavior.answer(WORLD._replace(ball_x_m=40.0))
    assert (output.clamped, output.leaf_id, output.observation) == (True, 1, (40.0, 0.0))
    behavior.answer(WORLD)
    assert behavior.clamped_count == 1


def test_a_world_state_that_is_not_finite_is_refused_with_the_feature() -> None:
    with pytest.raises(BadInput, match="behavior 'seek': feature 'ball_distance' is nan"):
        Behavior("seek", TREE).answer(WORLD._replace(ball_x_m=nan))


@pytest.mark.parametrize(
    "features",
    [
        FEATURES[:1],
        FEATURES[::-1],
        (FEATURES[0]._replace(unit="cm"), FEATURES[1]),
        (FEATURES[0]._replace(name="range"), FEATURES[1]),
    ],
    ids=["count", "order", "units", "names"],
)
def test_a_tree_of_other_features_than_the_behavior_senses_is_refused(features: tuple[Feature, ...]) -> None:
    """Fault 37."""
    tree = Tree("ball_seeking", features, (0,), (Leaf(0.0, 0.0, 1),))
    with pytest.raises(BadInput, match=r"behavior 'ball_seeking' senses ball_distance \[m\], ball_bearing \[rad\]"):
        Behavior("seek", tree)


def test_a_behavior_may_bring_its_own_observation() -> None:
    observation = Observation((Feature("ball_x", "m", -2.0, 2.0),), lambda world: (world.ball_x_m,))
    tree = Tree("keeper", observation.features, (Split(0, 0.0, 1, 2), 0, 1), (Leaf(1.0, 1.0, 1), Leaf(2.0, 2.0, 1)))
    assert Behavior("keeper", tree, observation).answer(WORLD).leaf_id == 1
    with pytest.raises(BadInput, match="unknown behavior 'keeper'"):
        Behavior("keeper", tree)


def test_a_copy_answers_and_counts_as_the_original() -> None:
    behavior = Behavior("seek", TREE)
    behavior.answer(WORLD._replace(ball_x_m=40.0))
    for other in (copy.deepcopy(behavior), pickle.loads(pickle.dumps(behavior))):
        assert other.answer(WORLD) == behavior.answer(WORLD)
        assert other.answer(WORLD._replace(ball_x_m=40.0)).clamped
        assert (other.name, other.clamped_count, behavior.clamped_count) == ("seek", 2, 1)
