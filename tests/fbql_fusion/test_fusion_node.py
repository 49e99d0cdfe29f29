"""The fusion node: it decides a step once, with everybody, and knows what to do when somebody is not there."""

import csv
import json
import math
from time import monotonic

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from fbql_common.core.topic_names import CLOCK, DECISION, DIAGNOSTICS, behavior_topic
from fbql_common.core.types import DRIVER_BLEND, NO_LEAF, Decision
from fbql_common.qos import POSE_QOS
from fbql_common.spin import DONE, FAILED
from fbql_common.wire import encode_output, encode_world
from fbql_fusion import fusion_node
from fbql_fusion.core.session import episode_seed
from fbql_fusion.fusion_node import FusionNode
from fbql_fusion.policy_storage import load_policy
from fbql_msgs.msg import BehaviorOutput as BehaviorOutputMsg
from fbql_msgs.msg import WorldState
from fbql_msgs.srv import SavePolicy
from fbql_recording.run import open_run
from geometry_msgs.msg import PoseStamped
from hand_driven import BEHAVIORS, STEP_NS, FakeBehavior, FakeSimulator, Partner, listen, output_to, world_at
from rclpy.clock import Clock as RosClock
from rclpy.clock_type import ClockType
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.time import Time
from rosgraph_msgs.msg import Clock
from verified_run import verification_of

LEARNING = {"controller": "fbql_literal", "guided": 0, "tie_rule": "first"}


class Team:
    """A fusion node among partners that are driven by hand. Its behaviors answer at once unless told to be silent.

    `behavior_timeout_s` is 0 (never) unless a test is about it, so that a slow machine degrades nothing.
    """

    def __init__(self, bench, run, begin=True, **parameters):
        self.bench = bench
        self.run = run
        self.simulator = bench.add(FakeSimulator)
        self.behaviors = [bench.add(FakeBehavior, index) for index in range(3)]
        self.partner = bench.add(Partner)
        self.decisions = listen(self.partner, Decision, DECISION)
        usual = {"controller": "subsumption", "behavior_timeout_s": 0.0, "world_timeout_s": 60.0}
        parameters = {"run_directory": str(run), **usual, **parameters}
        self.fusion = bench.add(FusionNode, **parameters)
        if begin:
            bench.until(lambda: self.simulator.granted, "the first episode to be asked for")
            self.decided(0)

    def decided(self, step):
        """Waits until the command and the decision of a step have come."""
        for heard, what in ((self.simulator.commands, "command"), (self.decisions, "decision")):
            self.bench.until(lambda heard=heard: heard and heard[-1].step == step, f"the {what} of step {step}")
        return self.decisions[-1]

    def play(self, *steps, episode=0, **fields):
        """Shows world states one by one and waits for each decision."""
        for step in steps:
            self.simulator.show(episode, step, **fields)
            self.decided(step)

    def policy(self, path):
        """The policy file as the save_policy service writes it now."""
        answer = self.bench.call(self.partner, SavePolicy, "fusion/save_policy", path=str(path))
        assert answer.success, answer.message
        return path.read_bytes()

    def silence(self, *indices):
        for index in indices:
            self.behaviors[index].silent = True


@pytest.fixture
def make_team(bench, tmp_path):
    return lambda **parameters: Team(bench, tmp_path / "run", **parameters)


# The step


def test_first_step_waits_for_every_behavior(make_team, bench):
    team = make_team(begin=False, behavior_timeout_s=0.1)
    team.silence(0, 1, 2)
    bench.until(lambda: all(behavior.worlds for behavior in team.behaviors), "the first world state")
    world = team.behaviors[0].worlds[0]
    team.behaviors[1].answer(world)
    team.behaviors[0].answer(world)
    asked_s = monotonic()
    bench.until(lambda: monotonic() > asked_s + 0.3, "three times behavior_timeout_s")
    assert not team.decisions, "decided without all"
    team.behaviors[2].answer(world)
    decision = team.decided(0)
    assert decision.joint_state == (0, 1, 2) and not decision.degraded


def test_episode_is_asked_for_with_the_seed_of_the_run(make_team):
    team = make_team(seed=5)
    assert team.simulator.granted == [(0, episode_seed(5, 0))]


def test_command_carries_the_step_and_its_stamp(make_team):
    team = make_team(controller="uniform")
    team.play(1, 2)
    command, decision = team.simulator.commands[-1], team.decisions[-1]
    assert command[:3] == decision[:3] == (team.simulator.stamp_ns, 0, 2)
    assert (command.left_rad_s, command.right_rad_s) == pytest.approx((20.0, -4.0))
    assert decision.weights == pytest.approx((1 / 3,) * 3) and decision.driver == DRIVER_BLEND


def test_answers_may_come_before_the_world_does(make_team, bench):
    team = make_team()
    team.silence(0, 1, 2)
    team.simulator.stamp_ns += STEP_NS
    world = world_at(0, 1, team.simulator.stamp_ns)
    for behavior in team.behaviors:
        behavior.answer(world)
    team.simulator.show_again(world)
    assert team.decided(1).joint_state == (0, 1, 2)


def test_world_that_is_shown_again_gets_the_same_command_again(make_team, bench):
    team = make_team()
    world = team.simulator.show(0, 1)
    team.decided(1)
    count = len(team.simulator.commands)
    team.simulator.show_again(world)
    bench.until(lambda: len(team.simulator.commands) > count, "the command again")
    assert team.simulator.commands.data[-1] == team.simulator.commands.data[count - 1]
    team.play(2)
    assert [decision.step for decision in team.decisions] == [0, 1, 2]


def play_with_reward(team, again):
    """Five steps with collisions; `again` shows and answers each of them again."""
    for step in range(1, 6):
        world = team.simulator.show(0, step, collision_begun=step % 2 == 1, collision=True)
        if again:
            team.simulator.show_again(world)
            for behavior in team.behaviors:
                behavior.answer(world)
        team.decided(step)
        if again:
            team.simulator.show_again(world)
            for behavior in team.behaviors:
                behavior.answer(world)


def test_duplicates_cause_no_second_q_update(bench, tmp_path):
    policies, digests = [], []
    for name, again in (("once", False), ("twice", True)):
        team = Team(bench, tmp_path / name, **LEARNING)
        play_with_reward(team, again)
        policies.append(team.policy(tmp_path / f"{name}.npz"))
        for node in (team.fusion, team.simulator, *team.behaviors, team.partner):
            bench.remove(node)
        digests.append(json.loads((tmp_path / name / "summary.json").read_text())["digest"])
    assert policies[0] == policies[1]
    assert digests[0] == digests[1]
    q = load_policy(tmp_path / "once.npz").arrays["q"]
    assert q.size and (q < 0).any(), "nothing was learned, so that nothing was tested"


def test_older_world_and_older_answers_change_nothing(make_team, bench):
    team = make_team()
    old = team.simulator.show(0, 1)
    team.decided(1)
    team.play(2)
    team.simulator.show_again(old)
    for behavior in team.behaviors:
        behavior.answer(old)
    bench.until_said("episode 0, step 1 is older than the last (1 dropped so far)")
    team.play(3)
    assert [decision.step for decision in team.decisions] == [0, 1, 2, 3]
    assert not team.decisions[-1].degraded


@pytest.mark.parametrize(
    "changes",
    [{"stamp_ns": 0}, {"stamp_ns": 1}, {"stamp_ns": 10**15}, {"step": 0}, {"episode": 4}],
    ids=["no stamp", "stale stamp", "future stamp", "another step", "another episode"],
)
def test_answer_that_does_not_belong_to_the_step_is_no_answer(make_team, bench, changes):
    team = make_team(lockstep_timeout_s=0.2)
    team.behaviors[1].fields = changes
    team.simulator.show(0, 1)
    bench.until(team.fusion.finished.done, "the run to end")
    assert team.fusion.finished.result() == FAILED
    assert "no answer from wall_avoiding within 0.2 s" in bench.said()
    said = bench.said().count("/behaviors/wall_avoiding: a message has no stamp (reported once)")
    assert said == (changes.get("stamp_ns") == 0)
    assert [decision.step for decision in team.decisions] == [0]


def test_answers_from_the_future_do_not_keep_a_step_from_its_own(make_team, bench):
    team = make_team(lockstep_timeout_s=5.0)
    team.silence(1)
    world = team.simulator.show(0, 1)
    for ahead in range(1, 40):
        future = world._replace(stamp_ns=world.stamp_ns + ahead * STEP_NS, step=1 + ahead)
        team.behaviors[1].publisher.publish(encode_output(output_to(future, 1)))
    bench.until(lambda: team.behaviors[1].answered and team.behaviors[1].answered[-1].step == 40, "the last of them")
    team.behaviors[1].answer(world)
    decision = team.decided(1)
    assert not decision.degraded


def test_after_a_stall_the_command_of_the_newest_world_state_is_the_last(make_team, bench):
    """While fusion stands still, world states and answers pile up; then they all come at once."""
    team = make_team()
    for step in range(1, 9):
        world = team.simulator.show(0, step)
        for behavior in team.behaviors:
            behavior.silent = True
            behavior.answer(world)
    team.decided(8)
    steps = [decision.step for decision in team.decisions]
    assert steps == sorted(set(steps)), "each at most once, in order"
    assert team.simulator.commands[-1].step == 8


def test_a_fusion_node_ends_with_its_result_and_says_whose_controller_it_plays(make_team, bench):
    team = make_team(episodes=2)
    bench.until_said("fusion: subsumption of ball_seeking, ")
    team.play(1)
    team.simulator.show(0, 2, goal=True, terminated=True)
    team.decided(2)
    bench.remove(team.fusion)
    assert "fusion: ended early: goals 1, episodes 1 of 2; run in " in bench.said()


@pytest.mark.parametrize(
    ("given", "controller", "goals", "named"),
    [
        ({}, "fbql", 10, "fbql with the shipped policy of"),
        ({"episodes": 2}, "fbql", 0, "fbql with the shipped policy of"),
        ({"goals": 0, "policy": "none"}, "fbql", 0, "fbql of"),
        ({"policy": "shipped", "controller": "fbql"}, "fbql", 10, "fbql with the shipped policy of"),
        ({"guided": 2}, "fbql", 10, "fbql of"),
        ({"behaviors": ["ball_seeking", "approaching"]}, "fbql", 10, "fbql of"),
        ({"preset": "paper"}, "subsumption", 10, "subsumption of"),
        ({"controller": "uniform"}, "uniform", 10, "uniform of"),
    ],
)
def test_what_it_is_not_told_is_as_bringup_plays_it(bench, tmp_path, given, controller, goals, named):
    node = bench.add(FusionNode, run_directory=str(tmp_path / "run"), **given)
    assert node.get_parameter("controller").value == controller
    assert node.get_parameter("goals").value == goals
    bench.until_said(f"fusion: {named} ball_seeking, ")


def test_errors_that_are_repeated_are_not_silenced_by_a_wall_clock_that_is_stepped_back(make_team, bench, monkeypatch):
    """The clock of rclpy's throttle is the wall clock by default."""
    team = make_team(begin=False)
    moments = iter(range(10**9, 0, -1))
    now = RosClock.now
    is_steady = ClockType.STEADY_TIME
    monkeypatch.setattr(
        RosClock, "now", lambda self: now(self) if self.clock_type == is_steady else Time(seconds=next(moments))
    )
    monkeypatch.setattr("time.time", lambda: float(next(moments)))

    def say():
        team.fusion._say_again_and_again("still so")
        return bench.said().count("still so") >= 2

    bench.until(say, "it to be said twice")


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"leaf_id": 5}, "leaf_id 5 is outside of 0..4"),
        ({"leaf_id": -1}, "leaf_id -1 is outside of 0..4"),
        ({"left_rad_s": math.nan}, "a reference is not finite"),
        ({"right_rad_s": -math.inf}, "a reference is not finite"),
    ],
)
def test_answer_that_cannot_be_acted_on_is_dropped_and_the_step_goes_on_without(make_team, bench, changes, reason):
    team = make_team(behavior_timeout_s=0.1)
    team.behaviors[2].fields = changes
    team.simulator.show(0, 1)
    decision = team.decided(1)
    assert reason in bench.said()
    assert f"{bench.namespace}/behaviors/approaching" in bench.said()
    assert decision.joint_state == (0, 1, NO_LEAF)
    assert decision.weights[2] == 0.0 and decision.degraded


@pytest.mark.parametrize(
    ("frame", "shown"),
    [("base_link", "base_link"), ("x\n[INFO] all is well\x1b[31m", r"x\n[INFO] all is well\x1b[31m")],
)
def test_answer_of_another_frame_is_dropped_naming_both_frames_escaped(make_team, bench, frame, shown):
    team = make_team(behavior_timeout_s=0.1)
    team.silence(0)
    world = team.simulator.show(0, 1)
    message = BehaviorOutputMsg(episode=0, step=1, name=BEHAVIORS[0], leaf_count=5, tree_hash="aa" * 32)
    message.header.stamp.nanosec = world.stamp_ns
    message.header.frame_id = frame
    team.behaviors[0].publisher.publish(message)
    bench.until_said(f"frame_id is '{shown}', expected 'field'")
    assert team.decided(1).degraded


@pytest.mark.parametrize("garbage", [b"", b"\x00\x01\x00\x00short", b"\xff" * 400])
def test_garbage_on_every_input_is_dropped_and_play_goes_on(make_team, bench, garbage):
    team = make_team()
    for node in (team.simulator, *team.behaviors):
        node.publisher.publish(garbage)
    for topic in ("world", *map(behavior_topic, BEHAVIORS)):
        bench.until_said(f"dropped a message on {bench.namespace}/{topic}: malformed")
    team.play(1)
    assert not team.decisions[-1].degraded


@pytest.mark.parametrize(
    "weights", [(math.nan,) * 3, (0.5, math.inf, 0.5), (0.5, 0.5), ()], ids=["nan", "inf", "too few", "none"]
)
def test_weights_that_are_no_weights_become_uniform(make_team, weights):
    team = make_team(controller="uniform")
    team.fusion._session._controller.select = lambda *_: (weights, DRIVER_BLEND, (), ())
    team.play(1)
    assert team.decisions[-1].weights == pytest.approx((1 / 3,) * 3)
    assert team.simulator.commands[-1].left_rad_s == pytest.approx(20.0)


def test_answers_from_another_tree_than_before_are_not_used_and_said(make_team, bench):
    team = make_team(controller="uniform")
    team.play(1)
    team.behaviors[0].fields = {"tree_hash": "dd" * 32}
    team.play(2)
    assert team.decisions[-1].joint_state == (NO_LEAF, 1, 2) and team.decisions[-1].degraded
    bench.until_said("not used so far: 1 answers from another tree than the behavior's first")
    team.behaviors[0].fields = {}
    team.play(3)
    assert team.decisions[-1].joint_state == (0, 1, 2)


# What does not come


def test_missing_inputs_are_named(bench, tmp_path, monkeypatch):
    monkeypatch.setattr(fusion_node, "_SAY_PERIOD_S", 0.1)
    bench.add(FusionNode, run_directory=str(tmp_path / "run"))
    bench.until_said("waiting for ")
    line = next(line for line in bench.said().splitlines() if "waiting for " in line)
    for what in ("world", *map(behavior_topic, BEHAVIORS), "simulator/reset_episode", "wheel_command"):
        assert f"{bench.namespace}/{what}" in line


def test_missing_behavior_alone_is_named(bench, tmp_path, monkeypatch):
    monkeypatch.setattr(fusion_node, "_SAY_PERIOD_S", 0.1)
    simulator = bench.add(FakeSimulator)
    for index in (0, 2):
        bench.add(FakeBehavior, index)
    bench.add(FusionNode, run_directory=str(tmp_path / "run"))
    bench.until_said(f"waiting for {bench.namespace}/behaviors/wall_avoiding\n")
    assert not simulator.granted


def test_behavior_of_other_qos_is_an_error_and_is_waited_for(bench, tmp_path, monkeypatch):
    monkeypatch.setattr(fusion_node, "_SAY_PERIOD_S", 0.1)
    bench.add(FakeSimulator)
    for index in (0, 2):
        bench.add(FakeBehavior, index)
    topic = behavior_topic(BEHAVIORS[1])
    stray = bench.add(Partner)
    stray.create_publisher(BehaviorOutputMsg, topic, QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT))
    bench.add(FusionNode, run_directory=str(tmp_path / "run"))
    bench.until_said(f"{bench.namespace}/{topic}: a publisher's QoS is incompatible in RELIABILITY")
    bench.until_said(f"waiting for {bench.namespace}/{topic}")


def test_behavior_of_another_type_is_an_error_and_is_waited_for(bench, other_bench, tmp_path, monkeypatch):
    monkeypatch.setattr(fusion_node, "_SAY_PERIOD_S", 0.1)
    topic = behavior_topic(BEHAVIORS[0])
    other_bench.add(Partner, "stray").create_publisher(PoseStamped, topic, 10)
    bench.add(FusionNode, run_directory=str(tmp_path / "run"))
    bench.until_said("publishes geometry_msgs/msg/PoseStamped, expected fbql_msgs/msg/BehaviorOutput")
    assert f"{bench.namespace}/{topic}: " in bench.said()
    bench.until_said(f"{bench.namespace}/{topic}, ")


def test_behavior_that_stops_answering_is_left_out_within_its_time(make_team, bench):
    team = make_team(controller="uniform", behavior_timeout_s=0.1)
    team.play(1)
    team.silence(1)
    shown_s = monotonic()
    team.simulator.show(0, 2)
    decision = team.decided(2)
    took_s = monotonic() - shown_s
    assert 0.1 < took_s < 0.5, "the timer looks every 0.02 s"
    assert decision.degraded and decision.joint_state == (0, NO_LEAF, 2)
    assert decision.weights == pytest.approx((0.5, 0.0, 0.5))
    assert team.simulator.commands[-1].left_rad_s == pytest.approx((10.0 + 30.0) / 2)
    bench.until_said("no answer from wall_avoiding within 0.1 s: continuing without it; nothing more is learned")
    shown_s = monotonic()
    team.play(*range(3, 10))
    assert monotonic() - shown_s < 0.7, "it was waited for again at every step"
    assert bench.said().count("no answer from") == 1


def test_degraded_episode_is_not_learned_from_and_the_next_one_is(make_team, tmp_path):
    team = make_team(behavior_timeout_s=0.1, **LEARNING)
    team.play(1, 2, collision_begun=True, collision=True)
    before = team.policy(tmp_path / "before.npz")
    team.silence(0)
    team.play(3, collision_begun=True, collision=True)
    team.behaviors[0].silent = False
    team.play(4, 5, collision_begun=True, collision=True)
    assert team.decisions[-1].degraded
    assert team.policy(tmp_path / "after.npz") == before
    team.play(6, terminated=True, goal=True)
    team.bench.until(lambda: len(team.simulator.granted) == 2, "the next episode")
    team.decided(0)
    team.play(1, 2, episode=1, collision_begun=True, collision=True)
    assert not team.decisions[-1].degraded
    assert team.policy(tmp_path / "next.npz") != before
    team.silence(0)
    team.play(3, episode=1)
    assert team.bench.said().count("no answer from ball_seeking") == 2, "it is said once in each episode"


def test_behavior_that_answers_again_is_waited_for_again(make_team, bench):
    team = make_team(behavior_timeout_s=0.1)
    team.silence(1)
    team.play(1)
    team.behaviors[1].silent = False
    team.play(2)
    bench.until(lambda: team.behaviors[1].worlds[-1].step == 2, "the world state at the behavior")
    team.play(3, 4)
    assert team.decisions[-1].joint_state == (0, 1, 2)


def test_world_that_does_not_come_ends_the_run_where_it_may_not_wait_for_ever(make_team, bench):
    team = make_team(lockstep_timeout_s=0.3)
    team.play(1)
    bench.until(team.fusion.finished.done, "the run to end")
    assert team.fusion.finished.result() == FAILED
    assert f"no world state of the episode on {bench.namespace}/world within 0.3 s" in bench.said()


def test_late_answers_do_not_make_fusion_wait_at_every_step(make_team, bench):
    team = make_team(behavior_timeout_s=0.1)
    team.silence(1)
    team.play(1, 2, 3)
    team.behaviors[1].answer(world_at(0, 1, team.behaviors[1].worlds[1].stamp_ns))
    shown_s = monotonic()
    team.play(*range(4, 11))
    assert monotonic() - shown_s < 0.7, "it was waited for at every step"


def test_behavior_that_is_always_a_little_late_is_said_once_an_episode(make_team, bench):
    team = make_team(behavior_timeout_s=0.1)
    team.silence(1)
    for step in (1, 2, 3):
        world = team.simulator.show(0, step)
        shown_s = monotonic()
        team.decided(step)
        assert monotonic() - shown_s > 0.1, "it was not waited for"
        team.behaviors[1].answer(world)
        answered = team.behaviors[1].answered
        bench.until(lambda answered=answered, step=step: answered[-1].step == step, "the late answer")
    assert bench.said().count("no answer from wall_avoiding") == 1


def test_time_out_is_not_put_off_by_world_states_that_come_again(make_team, bench):
    team = make_team(lockstep_timeout_s=0.3)
    team.silence(0, 2)
    world = team.simulator.show(0, 1)
    shown = [*team.behaviors[0].worlds, world]
    shown_s = monotonic()

    def show_again():
        if len(team.behaviors[0].worlds) == len(shown):
            shown.append(team.simulator.show_again(world))
        return team.fusion.finished.done()

    bench.until(show_again, "the run to end")
    assert monotonic() - shown_s < 1.0
    assert len(shown) > 3, "the world state did not come again"
    assert team.fusion.finished.result() == FAILED
    assert "no answer from ball_seeking, approaching within 0.3 s" in bench.said()


def test_time_out_is_not_put_off_by_new_world_states_of_real_time(make_team, bench):
    team = make_team(controller="uniform", behavior_timeout_s=0.1)
    team.silence(1)
    seen = team.behaviors[0].worlds
    team.simulator.show(0, 1)
    shown_s = monotonic()

    def next_step():
        if seen[-1].stamp_ns == team.simulator.stamp_ns:
            team.simulator.show(0, seen[-1].step + 1)
        return team.decisions[-1].step > 0

    bench.until(next_step, "a decision")
    assert monotonic() - shown_s < 0.6
    assert seen[-1].step > 3, "no new world state came in that time"
    assert team.decisions[-1].weights == pytest.approx((0.5, 0.0, 0.5))


def test_pipeline_slower_than_the_step_decides_every_step(make_team, bench):
    team = make_team()
    team.silence(0, 1, 2)
    worlds = [team.simulator.show(0, step) for step in range(1, 4)]
    bench.until(lambda: all(behavior.worlds[-1].step == 3 for behavior in team.behaviors), "step 3 at the behaviors")
    for world in worlds:
        for behavior in team.behaviors:
            behavior.answer(world)
    team.decided(3)
    assert [decision.step for decision in team.decisions] == [0, 1, 2, 3]
    assert not team.decisions[-1].degraded


def test_pipeline_that_moves_on_is_not_late(make_team, bench):
    team = make_team(behavior_timeout_s=0.1)
    team.silence(0, 1, 2)
    began_s = monotonic()
    world = team.simulator.show(0, 1)
    while monotonic() < began_s + 0.4:
        following = team.simulator.show(0, world.step + 1)
        bench.until(lambda: team.behaviors[2].worlds[-1].stamp_ns == team.simulator.stamp_ns, "the world state")
        for behavior in team.behaviors:
            behavior.answer(world)
        team.decided(world.step)
        world = following
    assert not team.decisions[-1].degraded


def test_no_behavior_left_stops_the_wheels(make_team, bench):
    team = make_team(behavior_timeout_s=0.1)
    team.silence(0, 1, 2)
    team.simulator.show(0, 1)
    decision = team.decided(1)
    assert decision.degraded and decision.joint_state == (NO_LEAF,) * 3
    command = team.simulator.commands[-1]
    assert (command.left_rad_s, command.right_rad_s) == (0.0, 0.0)
    bench.until_said("no behavior answers: the wheels are stopped")
    assert any("[ERROR]" in line and "no behavior answers" in line for line in bench.said().splitlines())


def test_all_behaviors_may_come_back(make_team):
    team = make_team(behavior_timeout_s=0.1)
    team.silence(0, 1, 2)
    team.play(1)
    for behavior in team.behaviors:
        behavior.silent = False
    team.play(2, 3)
    assert team.decisions[-1].joint_state == (0, 1, 2)


def test_first_answers_that_do_not_come_are_named(make_team, bench, monkeypatch):
    monkeypatch.setattr(fusion_node, "_SAY_PERIOD_S", 0.1)
    team = make_team(begin=False)
    team.silence(2)
    bench.until_said("waiting for an answer from approaching")


def test_nothing_is_decided_or_learned_before_simulated_time_comes(make_team, bench, tmp_path):
    team = make_team(begin=False, use_sim_time=True)
    bench.until(lambda: team.simulator.granted, "the first episode to be asked for")
    bench.until_said("use_sim_time is set and no /clock has come yet")
    world = team.behaviors[0].worlds[0]
    clock = team.partner.create_publisher(Clock, CLOCK, POSE_QOS)
    bench.until(lambda: clock.get_subscription_count() == 1, "fusion to subscribe /clock")
    assert not team.simulator.commands and not team.decisions
    message = Clock()
    message.clock.sec = 1
    clock.publish(message)
    bench.until(lambda: team.fusion.get_clock().now().nanoseconds == 10**9, "simulated time")
    team.simulator.show_again(world)
    assert not team.decided(0).degraded


def test_world_that_is_not_finite_is_not_decided(make_team, bench):
    team = make_team()
    message = WorldState(episode=0, step=1, robot_x_m=math.nan)
    message.header.frame_id = "field"
    message.header.stamp.nanosec = team.simulator.stamp_ns + STEP_NS
    team.simulator.publisher.publish(message)
    bench.until_said(f"dropped a message on {bench.namespace}/world: a pose or velocity is not finite")
    team.play(1)
    assert [decision.step for decision in team.decisions] == [0, 1]


def test_wheels_are_stopped_when_the_world_stops(make_team, bench):
    team = make_team(world_timeout_s=0.1)
    team.play(1)
    bench.until(lambda: (team.simulator.commands[-1].left_rad_s) == 0.0, "a zero command")
    last = team.simulator.commands[-1]
    assert last.step == 1, "in lockstep nobody must take it for the answer to the next step"
    bench.until_said("no world state of the episode for 0.1 s: the wheels are stopped")
    team.play(2)
    assert team.simulator.commands[-1].left_rad_s != 0.0
    assert bench.said().count("the wheels are stopped") == 1


# Episodes


def test_next_episode_is_asked_for_when_one_has_ended(make_team, bench):
    team = make_team(seed=3, episodes=2)
    team.play(1, terminated=True, goal=True)
    bench.until(lambda: len(team.simulator.granted) == 2, "the next episode")
    assert team.simulator.granted[1] == (1, episode_seed(3, 1))
    team.decided(0)
    team.play(1, episode=1, truncated=True)
    bench.until(team.fusion.finished.done, "the run to end")
    assert team.fusion.finished.result() == DONE
    summary = json.loads((team.run / "summary.json").read_text())
    assert (summary["episodes"], summary["goals"], summary["timeouts"], summary["steps"]) == (2, 1, 1, 2)
    assert summary["messages_recorded"] == 4 * 6 and not summary["incomplete"]
    rows = list(csv.DictReader((team.run / "episodes.csv").open()))
    assert [row["outcome"] for row in rows] == ["goal", "timeout"]


def test_ended_world_that_is_shown_again_counts_once(make_team, bench):
    team = make_team()
    world = team.simulator.show(0, 1, terminated=True, own_goal=True)
    team.decided(1)
    team.simulator.show_again(world)
    bench.until(lambda: len(team.simulator.granted) == 2, "the next episode")
    team.decided(0)
    assert len(team.fusion._session.records) == 1


def test_refused_episode_ends_the_run_with_the_reason(make_team, bench):
    team = make_team()
    team.simulator.refusal = "out of order"
    team.simulator.show(0, 1, terminated=True, goal=True)
    bench.until(team.fusion.finished.done, "the run to end")
    assert team.fusion.finished.result() == FAILED
    assert "the simulator refused an episode: out of order" in bench.said()


def test_simulator_that_is_away_between_episodes_is_asked_when_it_is_back(make_team, bench):
    team = make_team(behavior_timeout_s=0.1)
    world = team.simulator.show(0, 1, terminated=True, goal=True)
    bench.remove(team.simulator)
    bench.until(lambda: team.decisions[-1].step == 1, "the decision of the last step")
    assert team.decisions[-1].stamp_ns == world.stamp_ns
    team.simulator = bench.add(FakeSimulator)
    bench.until(lambda: team.simulator.granted, "the next episode to be asked for")
    assert team.simulator.granted[0] == (1, episode_seed(0, 1))


def test_simulator_that_was_started_again_is_asked_for_the_episode_again(make_team, bench, tmp_path):
    team = make_team(world_timeout_s=0.5, **LEARNING)
    team.play(1, 2, collision_begun=True, collision=True)
    learned = team.policy(tmp_path / "before.npz")
    bench.remove(team.simulator)
    team.simulator = bench.add(FakeSimulator)
    bench.until(lambda: team.simulator.publisher.get_subscription_count() == 4, "the new simulator to be heard")

    team.simulator.show(-1, 0)

    def idle():
        if team.behaviors[0].worlds[-1].stamp_ns == team.simulator.stamp_ns and not team.simulator.granted:
            team.simulator.show(-1, 0)
        return team.simulator.granted

    bench.until(idle, "the episode to be asked for again")
    assert team.simulator.granted[0] == (0, episode_seed(0, 0))
    assert "episode 0 is lost and begins again; nothing more is learned in it" in bench.said()
    team.decided(0)
    team.play(1, 2, collision_begun=True, collision=True)
    assert team.decisions[-1].degraded
    assert team.policy(tmp_path / "after.npz") == learned
    team.play(3, terminated=True, goal=True)
    bench.until(lambda: len(team.simulator.granted) == 2, "the next episode")
    assert team.simulator.granted[1] == (1, episode_seed(0, 1))
    bench.remove(team.fusion)
    assert [step.begins_again for step in open_run(team.run).steps()].index(True) == 3
    verified = verification_of(team.run)
    assert (verified.difference, verified.steps) == (None, len(team.decisions))


def test_episode_whose_first_world_gets_lost_is_played_from_where_it_is_found(make_team, bench):
    team = make_team(world_timeout_s=0.1)
    team.simulator.loses_first = True
    team.play(1, terminated=True, goal=True)
    bench.until(lambda: len(team.simulator.granted) == 2, "the next episode")

    def next_step():
        world = team.behaviors[0].worlds[-1]
        if world.stamp_ns == team.simulator.stamp_ns:
            team.simulator.show(1, world.step + 1)
        return team.decisions[-1].episode == 1

    bench.until(next_step, "a decision in the next episode")
    assert team.decisions[-1].step > 0 and team.decisions[-1].degraded
    assert team.simulator.granted[1:] == [(1, episode_seed(0, 1))] * 2, "it was asked for again once"
    bench.remove(team.fusion)
    assert verification_of(team.run).difference is None


def test_world_states_of_somebody_else_do_not_end_an_episode_under_way(make_team, bench):
    team = make_team(world_timeout_s=0.1)
    steps = iter(range(1, 10_000))
    began_s = monotonic()

    def both():
        step = next(steps)
        team.simulator.publisher.publish(encode_world(world_at(-1, 0, 5)))
        team.play(step)
        return monotonic() > began_s + 0.3

    bench.until(both, "three times world_timeout_s")
    assert len(team.simulator.granted) == 1
    assert not team.decisions[-1].degraded


# Services and diagnostics


def test_policy_is_saved_to_the_run_directory_unless_told_where(make_team, bench):
    team = make_team(**LEARNING)
    team.play(1, collision_begun=True, collision=True)
    answer = bench.call(team.partner, SavePolicy, "fusion/save_policy")
    assert answer.success and answer.message == str(team.run / "policy.npz")
    policy = load_policy(team.run / "policy.npz")
    assert policy.behaviors == BEHAVIORS and policy.leaf_counts == (5, 5, 5)


def test_nothing_learned_is_nothing_to_save(make_team, bench):
    team = make_team(controller="subsumption")
    answer = bench.call(team.partner, SavePolicy, "fusion/save_policy")
    assert not answer.success and "has learned nothing to save" in answer.message
    assert not (team.run / "policy.npz").exists()


@pytest.mark.parametrize("path", ["/proc/policy.npz", "/dev/null/policy.npz", "{run}"])
def test_policy_that_cannot_be_written_is_told_and_play_goes_on(make_team, bench, path):
    team = make_team(**LEARNING)
    team.play(1)
    answer = bench.call(team.partner, SavePolicy, "fusion/save_policy", path=path.format(run=team.run))
    assert not answer.success and answer.message
    team.play(2)


def test_diagnostics_tell_the_match_and_warn_when_degraded(make_team, bench):
    team = make_team(controller="uniform", behavior_timeout_s=0.1)
    statuses = []
    team.partner.create_subscription(DiagnosticArray, DIAGNOSTICS, lambda m: statuses.extend(m.status), POSE_QOS)
    team.play(1)

    def last():
        return {pair.key: pair.value for pair in statuses[-1].values} if statuses else {}

    bench.until(lambda: last().get("step") == "1", "diagnostics of step 1")
    assert statuses[-1].name == f"{bench.namespace[1:]}/fusion: match"
    assert statuses[-1].level == DiagnosticStatus.OK
    assert last()["weights"] == "ball_seeking 0.33 wall_avoiding 0.33 approaching 0.33"
    team.behaviors[0].publisher.publish(b"garbage")
    team.silence(2)
    team.play(2)
    bench.until(lambda: last()["step"] == "2", "diagnostics of step 2")
    assert statuses[-1].level == DiagnosticStatus.WARN and last()["dropped"] == "1"


def test_everything_that_was_decided_is_recorded_whatever_came_beside_it(make_team, bench):
    team = make_team()
    world = team.simulator.show(0, 1)
    team.simulator.show_again(world)
    team.behaviors[0].publisher.publish(encode_output(output_to(world, 0, stamp_ns=5)))
    team.decided(1)
    team.play(2)
    bench.remove(team.fusion)
    summary = json.loads((team.run / "summary.json").read_text())
    assert summary["messages_recorded"] == 3 * 6


def test_run_that_cannot_begin_ends_naming_what_does_not_match(bench, make_team):
    team = make_team(begin=False, start_timeout_s=0.2, behaviors=["ball_seeking", "nobody"])
    bench.until(lambda: team.fusion.finished.done(), "the run to be given up")
    assert team.fusion.finished.result() == 1
    bench.until_said("can't begin: after 0.2 s there is no matching")


def test_world_far_ahead_of_the_episode_is_not_decided(bench, make_team):
    team = make_team()
    team.play(1)
    team.simulator.show(0, 1_000_000)
    team.play(2)
    assert [decision.step for decision in team.decisions] == [0, 1, 2]
    assert not team.decisions[-1].degraded
