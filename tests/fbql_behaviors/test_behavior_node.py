"""The behavior node: it answers sound world states, each as often as it is asked, and says why it does not."""

import math
from dataclasses import replace

import pytest
from fbql_behaviors.behavior_node import BehaviorNode
from fbql_behaviors.core.behavior import Behavior
from fbql_behaviors.core.tree import Leaf
from fbql_behaviors.observation_loading import load_observation
from fbql_behaviors.storage import load_tree, save_tree
from fbql_common import watch
from fbql_common.core.errors import BadInput
from fbql_common.core.topic_names import CLOCK, WORLD, behavior_topic
from fbql_common.core.types import BehaviorOutput
from fbql_common.qos import POSE_QOS, STEP_QOS
from fbql_common.wire import encode_world
from fbql_msgs.msg import WorldState
from hand_driven import STEP_NS, Partner, listen, shipped_tree, world_at
from places import ROOT
from rclpy.parameter import Parameter
from rosgraph_msgs.msg import Clock

NAME = "approaching"
EXAMPLE = ROOT / "examples/shooting"
TREE, SOURCE = EXAMPLE / "shooting.json", f"{EXAMPLE / 'shooting.py'}:shooting"
"""A behavior of the user's own, with its observation in a file."""


class Asked:
    """A behavior node and its partner, which publishes world states and hears the answers."""

    def __init__(self, bench, behavior=NAME, topic_name=NAME, **parameters):
        self.bench = bench
        self.node = bench.add(BehaviorNode, behavior, **parameters)
        self.partner = bench.add(Partner)
        self.answers = listen(self.partner, BehaviorOutput, behavior_topic(topic_name))
        self.publisher = self.partner.create_publisher(WorldState, WORLD, STEP_QOS)
        bench.until(lambda: self.publisher.get_subscription_count() == 1, "the behavior to subscribe world")
        answer_topic = behavior_topic(topic_name)
        bench.until(lambda: self.node.count_subscribers(answer_topic) == 1, "the answers to be heard")

    def ask(self, world):
        """Publishes a world state."""
        self.publisher.publish(encode_world(world))

    def answer_to(self, world):
        """Publishes a world state and waits for the answer to it."""
        self.ask(world)
        self.bench.until(
            lambda: self.answers and self.answers[-1].stamp_ns == world.stamp_ns, f"the answer to step {world.step}"
        )
        return self.answers[-1]


@pytest.fixture
def asked(bench):
    return Asked(bench)


def test_answer_is_that_of_the_tree_and_carries_the_step_and_its_stamp(asked):
    world = world_at(3, 17, ball_x_m=0.2, ball_y_m=-0.3)
    expected = Behavior(NAME, load_tree(shipped_tree(NAME))).answer(world)
    assert asked.answer_to(world) == expected
    assert expected[:4] == (world.stamp_ns, 3, 17, NAME)


def test_world_that_is_asked_again_gets_the_same_bytes_again(bench, asked):
    world = world_at(0, 4)
    asked.ask(world)
    asked.ask(world)
    bench.until(lambda: len(asked.answers) == 2, "two answers")
    assert asked.answers.data[0] == asked.answers.data[1]


def test_older_world_is_not_answered_and_counted(bench, asked):
    asked.answer_to(world_at(0, 5))
    asked.ask(world_at(0, 4))
    bench.until_said("episode 0, step 4 is older than the last (1 dropped so far)")
    asked.answer_to(world_at(0, 6))
    assert [answer.step for answer in asked.answers] == [5, 6]


def test_world_of_another_clock_far_ahead_is_not_answered_and_does_not_make_the_others_old(bench, asked):
    asked.answer_to(world_at(0, 5))
    asked.ask(world_at(0, 6, 3_600_000_000_000))
    bench.until_said("ahead of the last (1 dropped so far)")
    asked.answer_to(world_at(0, 6))
    assert [answer.step for answer in asked.answers] == [5, 6]


def test_first_world_of_a_simulator_that_was_started_again_is_answered(asked):
    asked.answer_to(world_at(0, 500))
    answer = asked.answer_to(world_at(-1, 0, STEP_NS))
    assert answer.episode == -1
    assert asked.answer_to(world_at(0, 1, 3 * STEP_NS)).step == 1


def test_time_may_begin_anew_after_a_pause(bench, asked, monkeypatch):
    monkeypatch.setattr(watch, "PAUSED_AFTER_S", 0.1)
    asked.answer_to(world_at(0, 500))
    bench.until_said("simulation paused")
    assert asked.answer_to(world_at(-1, 7)).step == 7


@pytest.mark.parametrize(("field", "bad"), [("robot_x_m", math.nan), ("ball_vx_m_s", math.inf)])
def test_world_that_is_not_finite_is_not_answered(bench, asked, field, bad):
    message = WorldState(episode=0, step=1)
    message.header.frame_id = "field"
    setattr(message, field, bad)
    asked.publisher.publish(message)
    bench.until_said("a pose or velocity is not finite")
    asked.answer_to(world_at(0, 2))
    assert [answer.step for answer in asked.answers] == [2]


def test_world_so_far_out_that_its_distances_overflow_is_not_answered(bench):
    asked = Asked(bench, "ball_seeking", "ball_seeking")
    asked.ask(world_at(0, 1, robot_x_m=1.7e308, ball_x_m=-1.7e308))
    bench.until_said("'ball_distance' is inf")
    asked.answer_to(world_at(0, 2))
    assert [answer.step for answer in asked.answers] == [2]


def test_world_outside_the_root_region_is_answered_as_clamped(bench):
    """Fault 41."""
    asked = Asked(bench, "ball_seeking", "ball_seeking")
    assert not asked.answer_to(world_at(0, 0)).clamped
    assert asked.answer_to(world_at(0, 1, ball_x_m=50.0)).clamped


def test_bytes_that_are_not_a_world_are_not_answered(bench, asked):
    for garbage in (b"", b"\x00\x01\x00\x00", b"\xff" * 300, b"\x00\x01\x00\x00" + b"\xff" * 300):
        asked.publisher.publish(garbage)
    bench.until_said("malformed")
    asked.answer_to(world_at(0, 2))
    assert [answer.step for answer in asked.answers] == [2]


def test_zero_stamp_is_answered_and_warned_of_once(bench, asked):
    world = world_at(0, 0, 0)
    asked.ask(world)
    asked.ask(world)
    bench.until(lambda: len(asked.answers) == 2, "two answers")
    assert bench.said().count("has no stamp (reported once)") == 1


def test_nothing_is_answered_before_simulated_time_comes(bench):
    asked = Asked(bench, use_sim_time=True)
    asked.ask(world_at(0, 0))
    bench.until_said("use_sim_time is set and no /clock has come yet (1 dropped so far)")
    clock = asked.partner.create_publisher(Clock, CLOCK, POSE_QOS)
    bench.until(lambda: clock.get_subscription_count() == 1, "the behavior to subscribe /clock")
    message = Clock()
    message.clock.nanosec = 5
    clock.publish(message)
    bench.until(lambda: asked.node.get_clock().now().nanoseconds == 5, "simulated time")
    asked.answer_to(world_at(0, 1))
    assert [answer.step for answer in asked.answers] == [1]


def test_pause_of_the_simulation_is_said_once_and_so_is_its_end(bench, asked, monkeypatch):
    monkeypatch.setattr(watch, "PAUSED_AFTER_S", 0.3)
    asked.answer_to(world_at(0, 1))
    bench.until_said(f"simulation paused: no world state on {bench.namespace}/world")
    asked.answer_to(world_at(0, 2))

    def go_on():
        asked.ask(world_at(0, 3))
        return "simulation resumed" in bench.said()

    bench.until(go_on, "the end of the pause to be said")
    assert bench.said().count("simulation paused") == 1


def test_missing_simulator_is_named(bench):
    bench.add(BehaviorNode, NAME)
    bench.until_said(f"waiting for a simulator on {bench.namespace}/world")


def test_behavior_is_called_what_its_parameter_says(bench):
    asked = Asked(bench, "", "chasing", tree_file=str(shipped_tree("ball_seeking")), name="chasing")
    assert asked.answer_to(world_at(0, 1)).name == "chasing"


def test_tree_file_that_is_replaced_while_it_runs_changes_nothing_and_the_hash_tells_which_one_runs(bench, tmp_path):
    """Fault 42."""
    path, world = tmp_path / "tree.json", world_at(0, 1, ball_x_m=0.2, ball_y_m=-0.3)
    loaded = load_tree(shipped_tree("ball_seeking"))
    other = replace(loaded, leaves=tuple(Leaf(0.0, 0.0, 1) for _ in loaded.leaves))
    save_tree(path, loaded)
    asked = Asked(bench, "ball_seeking", "ball_seeking", tree_file=str(path))
    bench.until_said(f"tree {loaded.hash[:12]}, from tree.json")
    before = asked.answer_to(world)
    save_tree(path, other)
    after = asked.answer_to(world_at(0, 2, ball_x_m=0.2, ball_y_m=-0.3))
    path.unlink()
    last = asked.answer_to(world_at(0, 3, ball_x_m=0.2, ball_y_m=-0.3))
    for answer in (before, after, last):
        assert (answer.tree_hash, answer.left_rad_s) == (loaded.hash, before.left_rad_s)
    assert before.left_rad_s != 0.0
    assert other.hash != loaded.hash


def test_parameters_are_frozen_while_it_runs(asked):
    result = asked.node.set_parameters([Parameter("name", value="other")])[0]
    assert not result.successful
    assert asked.node.get_parameter("name").value == ""


def test_a_behavior_of_ones_own_answers_by_its_tree_and_marks_what_lies_outside_its_region(bench):
    asked = Asked(bench, "", "shooting", tree_file=str(TREE), observation=SOURCE)
    behavior = Behavior("shooting", load_tree(TREE), load_observation(SOURCE).observation)
    worlds = [world_at(0, 1, ball_x_m=0.2, ball_y_m=0.0), world_at(0, 2, robot_yaw_rad=2.0)]
    for world, clamped in zip(worlds, (False, True), strict=True):
        answer = asked.answer_to(world)
        assert (answer, answer.clamped) == (behavior.answer(world), clamped)


@pytest.mark.parametrize(
    ("parameters", "reason"),
    [
        ({"tree_file": str(TREE)}, "unknown behavior 'shooting'.*FILE.py:shooting"),
        ({"tree_file": str(TREE), "observation": "missing.py:shooting"}, "missing.py: no such file"),
        (
            {"tree_file": str(shipped_tree("ball_seeking")), "observation": SOURCE},
            "is the observation of behavior 'shooting', not of 'ball_seeking'",
        ),
    ],
)
def test_an_observation_that_is_not_the_trees_is_refused(bench, parameters, reason):
    with pytest.raises(BadInput, match=reason):
        bench.add(BehaviorNode, **parameters)
