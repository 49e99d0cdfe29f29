"""The behavior node with a behavior of the user's own: its tree, and its observation from a file."""

from __future__ import annotations

import pytest
from fbql_behaviors.behavior_node import BehaviorNode
from fbql_behaviors.core.behavior import Behavior
from fbql_behaviors.observation_loading import load_observation
from fbql_behaviors.storage import load_tree
from fbql_common.core.errors import BadInput
from fbql_common.core.types import BehaviorOutput
from fbql_common.topics import STEP_QOS, WORLD, behavior_topic
from fbql_common.wire import encode_world
from fbql_msgs.msg import WorldState
from hand_driven import Partner, listen, shipped_tree, world_at
from places import ROOT

EXAMPLE = ROOT / "examples/shooting"
TREE, SOURCE = EXAMPLE / "shooting.json", f"{EXAMPLE / 'shooting.py'}:shooting"


def test_it_answers_by_its_tree_and_says_where_it_does_not_know_what_to_do(bench):
    node = bench.add(BehaviorNode, tree_file=str(TREE), observation=SOURCE)
    partner = bench.add(Partner)
    answers = listen(partner, BehaviorOutput, behavior_topic("shooting"))
    publisher = partner.create_publisher(WorldState, WORLD, STEP_QOS)
    bench.until(lambda: publisher.get_subscription_count() == 1, "the behavior to subscribe world")
    bench.until(lambda: node.count_subscribers(behavior_topic("shooting")) == 1, "the answers to be heard")
    behavior = Behavior("shooting", load_tree(TREE), load_observation(SOURCE).observation)
    worlds = [world_at(0, 1, ball_x_m=0.2, ball_y_m=0.0), world_at(0, 2, robot_yaw_rad=2.0)]
    for world in worlds:
        publisher.publish(encode_world(world))
    bench.until(lambda: len(answers) == 2, "two answers")
    assert list(answers) == [behavior.answer(world) for world in worlds]
    assert [answer.clamped for answer in answers] == [False, True]


@pytest.mark.parametrize(
    ("parameters", "reason"),
    [
        ({"tree_file": str(TREE)}, "unknown behavior 'shooting'.*FILE.py:shooting"),
        ({"tree_file": str(TREE), "observation": "missing.py:shooting"}, "missing.py: cannot be read"),
        (
            {"tree_file": str(shipped_tree("ball_seeking")), "observation": SOURCE},
            "is the observation of behavior 'shooting', not of 'ball_seeking'",
        ),
    ],
)
def test_an_observation_that_is_not_the_trees_is_refused(bench, parameters, reason):
    with pytest.raises(BadInput, match=reason):
        bench.add(BehaviorNode, **parameters)
