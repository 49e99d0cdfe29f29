"""The node of a mux that learns decides what the core decides in one process, records it, and says so."""

from __future__ import annotations

import json
import math
import re
from time import monotonic

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from fbql.replay.mux_verification import verify_mux
from fbql_common.core.errors import BadInput
from fbql_common.core.mux_types import MuxDecision, RobotOutcome
from fbql_common.core.topic_names import DECISION, DIAGNOSTICS, OUTCOME
from fbql_common.core.twist import Twist
from fbql_common.qos import POSE_QOS, STEP_QOS
from fbql_common.wire import MESSAGES, decode_mux_decision, encode_number, encode_twist
from fbql_fusion.core.mux.learned import KNOWN_LOOKS
from fbql_fusion.policy_storage import load_policy, save_policy
from fbql_fusion.twist_mux_node import TwistMuxNode
from fbql_msgs.srv import SavePolicy
from fbql_recording.run import open_run
from mux_bench import OwnMux
from mux_lockstep import LearningMux, file_of
from places import ROOT
from rail import play, session_of


def in_process(policy=None, episodes=30, **changes):
    """The decisions of the same episodes without ROS, and their session."""
    session = session_of(policy, **changes)
    return session, play(session, episodes)


def test_thirty_episodes_through_the_node_are_those_in_one_process_bit_by_bit_and_are_recorded(
    bench, tmp_path, monkeypatch
):
    changes = {"fbql_prior": 1.0, "fbql_batch_episodes": 3}
    run = tmp_path / "run"
    mux = LearningMux(bench, tmp_path, file_of(**changes), "-p", "record:=true", "-p", f"run_directory:={run}")
    mux.play(30)
    session, expected = in_process(**changes)
    assert len(mux.decisions) == len(expected)
    for found, (decision, command) in zip(mux.decisions, expected, strict=True):
        assert found[: len(decision)] == decision
        assert found.command == command
    assert {decision.driver for decision, _ in expected} == {0, 1}
    bench.remove(mux.node)
    policy = load_policy(run / "policy.npz")
    for name, array in session.policy().arrays.items():
        assert np.array_equal(policy.arrays[name], array), name
    assert policy.arrays["counts"].tolist() == [30, session.policy().arrays["counts"][1]]
    summary = json.loads((run / "summary.json").read_text())
    assert summary["digest"] == session.digest
    told = session.summary()
    assert (summary["episodes"], summary["successes"], summary["failures"]) == (30, told.successes, told.failures)
    assert summary["incomplete"] is False
    assert len((run / "episodes.csv").read_text().splitlines()) == 31
    recorded = open_run(run)
    assert recorded.counts == {
        f"{bench.namespace}/fusion/decision": len(expected),
        f"{bench.namespace}/cmd_vel_out": len(mux.out),
    }
    verified = verify_mux(recorded, lambda _: None)
    assert (verified.steps, verified.difference, verified.digest) == (len(expected), None, session.digest)


def test_the_example_of_the_page_is_a_file_for_the_node(bench, tmp_path, monkeypatch):
    """rcl reads YAML 1.1, where `y` is a bool."""
    monkeypatch.chdir(tmp_path)
    (text,) = [
        each
        for each in re.findall(r"```yaml\n(.*?)```", (ROOT / "docs" / "mux.md").read_text(), re.DOTALL)
        if "learn: true" in each
    ]
    mux = OwnMux(bench, tmp_path, f"/**/{text}")
    assert [mux.node.get_parameter(f"observations.goal_{name}.field").value for name in ("distance", "bearing")] == [
        "x",
        "y",
    ]


def test_where_those_who_told_outcomes_have_gone_it_is_said_and_the_run_is_still_recomputed(bench, tmp_path):
    run = tmp_path / "run"
    mux = LearningMux(bench, tmp_path, file_of(), "-p", "record:=true", "-p", f"run_directory:={run}")
    said = []
    mux.partner.create_subscription(DiagnosticArray, DIAGNOSTICS, lambda message: said.append(message.status[0]), POSE_QOS)  # fmt: skip
    mux.play(1)
    bench.until(lambda: mux.node._learning.mux._looks >= KNOWN_LOOKS, "the publisher to be known")
    for _ in range(3):
        mux.let_time_pass()
    mux.partner.destroy_publisher(mux._outcome)
    bench.until_said(
        f"{bench.namespace}/outcome: nobody publishes outcomes any more, nothing is learned; the episode ends as truncated"
    )
    mux.let_time_pass(decisions=2)
    mux.let_time_pass()
    found = [(d.episode, d.step, d.truncated, d.degraded) for d in mux.decisions[-3:]]
    assert found == [(1, 4, True, True), (2, 0, False, False), (2, 2, False, True)]
    problem = "nobody publishes outcomes any more, nothing is learned"
    bench.until(lambda: said and said[-1].message.startswith(f"{problem}: "), "the diagnostics to say so")
    assert said[-1].level == DiagnosticStatus.WARN
    assert {pair.key: pair.value for pair in said[-1].values}["outcome"] == problem
    mux._outcome = mux.partner.create_publisher(MESSAGES[RobotOutcome], OUTCOME, STEP_QOS)
    bench.until_said(f"{bench.namespace}/outcome: somebody publishes again")
    mux.let_time_pass(decisions=2)
    mux.play(2)
    bench.remove(mux.node)
    assert verify_mux(open_run(run), lambda _: None)[:2] == (len(mux.decisions), None)


def test_a_saved_policy_is_played_as_in_one_process_and_another_robots_is_refused_in_one_line(bench, tmp_path):
    session, _ = in_process(episodes=60)
    path = tmp_path / "policy.npz"
    save_policy(path, session.policy())
    text = file_of(learn=False)
    mux = LearningMux(bench, tmp_path, text, "-p", f"policy:={path}")
    mux.play(5)
    _, expected = in_process(session.policy(), 5, learn=False)
    assert [found[: len(decision)] for found, (decision, _) in zip(mux.decisions, expected, strict=True)] == [
        decision for decision, _ in expected
    ]
    other = text.replace("down_vel", "other_vel").replace("down:", "other:")
    refused = (
        (other, "the policy fuses down, up, in this order; the behaviors here are other, up"),
        (text.replace("    axes", "      c: {topic: c, type: std_msgs/msg/Float64, field: data, low: 0.0, high: 1.0}\n    axes"),
         "'lengths' is int64"),
    )  # fmt: skip
    for changed, reason in refused:
        file = tmp_path / "changed.yaml"
        file.write_text(changed)
        words = ["--ros-args", "--params-file", str(file), "-p", f"policy:={path}"]
        with pytest.raises(BadInput) as refusal:
            bench.add(lambda **options: TwistMuxNode(cli_args=words, **options))  # noqa: B023
        assert reason in str(refusal.value)
        assert str(refusal.value).startswith(f"{bench.namespace}/twist_mux: ")


def test_with_other_levels_a_policy_ends_the_node_at_its_first_decision(bench, tmp_path):
    session, _ = in_process(episodes=30)
    path = tmp_path / "policy.npz"
    save_policy(path, session.policy())
    mux = OwnMux(bench, tmp_path, file_of(learn=False).replace("levels: 5", "levels: 7").replace("use_sim_time: true", "use_sim_time: false"), "-p", f"policy:={path}")  # fmt: skip
    bench.until(lambda: mux.node.finished.done(), "the node to end")
    assert mux.node.finished.result() == 2
    assert "the policy was learned with another tree of down" in bench.said()


WALL_TIME = {"learn": True, "controller": "priorities", "hold_s": 0.0}


def in_wall_time(bench, tmp_path, **changes):
    """A mux that decides by the priorities at each tick, in wall time."""
    return OwnMux(
        bench, tmp_path, file_of(**(WALL_TIME | changes)).replace("use_sim_time: true", "use_sim_time: false")
    )


def test_a_source_at_or_above_safety_priority_drives_whatever_is_learned(bench, tmp_path):
    mux = in_wall_time(bench, tmp_path)

    def up_drives():
        mux.send("up_vel", Twist(0.5))
        return mux.drivers[-1:] == ["up"]

    bench.until(up_drives, "the learned choice to drive")
    mux.send("joy_vel", Twist(-0.1))
    out = len(mux.out)
    for _ in range(3):
        mux.send("up_vel", Twist(0.5))
        mux.send("joy_vel", Twist(-0.1))
    bench.until(lambda: mux.out[out:].count(Twist(-0.1)) >= 3, "the joystick to drive")
    assert Twist(0.5) not in mux.out[out + 1 :]
    bench.until(up_drives, "the learned choice to drive again")


def test_what_came_while_the_mux_learned_is_as_old_as_it_is(bench, tmp_path):
    text = file_of(**WALL_TIME, decision_period_s=0.02).replace("use_sim_time: true", "use_sim_time: false")
    text = text.replace("timeout: 0.25, priority: 1}", "timeout: 60.0, priority: 1}")
    mux = OwnMux(bench, tmp_path, text.replace("{topic: a_position", "{topic: a_position, max_age_s: 0.25"))
    sensor = mux.partner.create_publisher(MESSAGES[float], "a_position", STEP_QOS)
    brief, lasting = (mux.publisher(topic, Twist) for topic in ("up_vel", "down_vel"))
    decisions = []
    mux.partner.create_subscription(
        MESSAGES[MuxDecision], DECISION, lambda data: decisions.append(decode_mux_decision(data)), STEP_QOS, raw=True
    )
    bench.until(lambda: decisions and sensor.get_subscription_count(), "the first decision")
    session = mux.node._learning.mux.session
    begin = session.next_episode

    def learn():
        """Takes longer than the brief source and the sensor may be silent; meanwhile both send their last message."""
        brief.publish(encode_twist(Twist(0.5)))
        lasting.publish(encode_twist(Twist(-0.5)))
        sensor.publish(encode_number(0.25))
        learned_s = monotonic() + 0.26
        while monotonic() < learned_s:
            pass
        return begin()

    session.next_episode = learn
    mux.node._learning.mux.hear_outcome(RobotOutcome(0, 1.0, terminated=True, outcome="success"))
    bench.until(lambda: Twist(-0.5) in mux.out, "the command that is not too old")
    bench.until(lambda: decisions[-1].step > 20, "more decisions")
    assert mux.received() == 2
    assert Twist(0.5) not in mux.out
    assert {each.active for each in decisions} == {(False, False), (True, False)}
    assert all(math.isnan(each.observed[0]) for each in decisions)


def test_while_sources_are_blended_all_their_names_are_who_drives(bench, tmp_path):
    mux = in_wall_time(bench, tmp_path, controller="uniform")

    def both_drive():
        mux.send("down_vel", Twist(-0.5))
        mux.send("up_vel", Twist(0.5))
        return mux.drivers[-1:] == ["down + up"]

    bench.until(both_drive, "the blend")
    bench.until(lambda: mux.out[-1:] == [Twist()], "the mean of both")
    bench.until(lambda: mux.drivers[-1:] == [""], "nobody to drive once both have expired")


def test_between_decisions_commands_of_the_chosen_source_are_passed_on_byte_for_byte_when_they_arrive(bench, tmp_path):
    mux = in_wall_time(bench, tmp_path, decision_period_s=0.2)

    def up_drives():
        mux.send("up_vel", Twist(0.5))
        return mux.drivers[-1:] == ["up"]

    bench.until(up_drives, "the first decision")
    before = len(mux.out)
    expected = []
    for number in range(1, 41):
        command = Twist(0.5, angular_y_rad_s=float(number))
        mux.send("up_vel", command)
        mux.send("down_vel", Twist(-0.5))
        expected.append(command)
    bench.until(lambda: mux.out[-1:] == expected[-1:], "the last command")
    assert [each for each in mux.out[before:] if each != Twist(0.5)] == expected, (
        "each once, in order, and none of the other"
    )


def test_a_policy_can_be_saved_meanwhile(bench, tmp_path):
    run = tmp_path / "run"
    mux = LearningMux(bench, tmp_path, file_of(), "-p", f"run_directory:={run}")
    answer = bench.call(mux.partner, SavePolicy, "twist_mux/save_policy", path="")
    assert (answer.success, "has learned nothing to save yet" in answer.message) == (False, True)
    mux.play(2)
    answer = bench.call(mux.partner, SavePolicy, "twist_mux/save_policy", path=str(tmp_path / "saved.npz"))
    assert (answer.success, answer.message) == (True, str(tmp_path / "saved.npz"))
    assert load_policy(tmp_path / "saved.npz").behaviors == ("down", "up")


def test_without_learn_and_policy_it_is_twist_mux_and_decides_nothing(bench, tmp_path):
    text = file_of(learn=False).replace("use_sim_time: true", "use_sim_time: false")
    mux = OwnMux(bench, tmp_path, text, "-p", "record:=true")
    mux.send("down_vel", Twist(-0.5))
    mux.send("up_vel", Twist(0.5))
    mux.send("down_vel", Twist(-0.5))
    bench.until(lambda: len(mux.out) == 2, "two commands")
    assert mux.out == [Twist(-0.5), Twist(0.5)]
    assert mux.partner.count_publishers("fusion/decision") == 0
    bench.until_said("nothing is recorded, because nothing is decided: set learn or policy")


def test_simulated_time_that_does_not_come_is_said(bench, tmp_path):
    OwnMux(bench, tmp_path, file_of())
    bench.until_said("use_sim_time is set and no /clock has come yet: nothing is decided before")


def test_an_observation_of_which_nothing_comes_is_named(bench, tmp_path):
    in_wall_time(bench, tmp_path)
    where = f"{bench.namespace}/a_position"
    bench.until_said(
        f"observation a_position: no std_msgs/msg/Float64 has come on {where} yet; until then it is unknown"
    )


def test_a_mux_that_cannot_begin_leaves_no_run_directory(bench, tmp_path):
    file = tmp_path / "twist_mux.yaml"
    file.write_text(file_of())
    words = [
        "--ros-args",
        "--params-file",
        str(file),
        "-p",
        f"run_directory:={tmp_path}/run",
        "-p",
        "reward_topic:='a b'",
    ]
    with pytest.raises(BadInput, match="parameter 'reward_topic': Invalid topic name"):
        bench.add(lambda **options: TwistMuxNode(cli_args=words, **options))
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (("type: std_msgs/msg/Float64", "type: std_msgs/msg/Flot64"), "message type 'std_msgs/msg/Flot64' is not installed here"),
        (("field: data", "field: 'data..x'"), "parameter 'observations.a_position.field': 'data..x' is not the path of a field"),
        (("topic: a_position", "topic: 'a position'"), "parameter 'observations.a_position.topic': Invalid topic name"),
        (("topic: a_position", "topic: up_vel"), "/up_vel, the one with geometry_msgs/msg/Twist, the other with std_msgs/msg/Float64; give"),
        (("learn: true", "learn: true\n    reward_topic: outcome"), "outcome and reward_topic are both "),
        (("    observations:", "    locks:\n      stop: {topic: down_vel, timeout: 0.0, priority: 3}\n    observations:"), "topics.down and locks.stop are both "),
        (("field: data, ", ""), "parameter 'observations.a_position.field' is missing"),
        (("low: -1.0", "low: 2.0"), "parameter 'observations.a_position.low' is 2, not below 'high' (1)"),
        (("linear_x", "linear_w"), "parameter 'axes.linear_w': not an axis of a Twist"),
        (("learn: true", "learn: true\n    safety_priority: 1"), "there is no source below safety_priority"),
        (("learn: true", "learn: true\n    policy: nowhere.npz"), "nowhere.npz: no such file"),
    ],
)  # fmt: skip
def test_an_error_in_what_is_learned_is_one_line_that_names_the_node(bench, tmp_path, change, reason):
    file = tmp_path / "twist_mux.yaml"
    file.write_text(file_of().replace(*change, 1))
    with pytest.raises(BadInput) as refusal:
        bench.add(lambda **options: TwistMuxNode(cli_args=["--ros-args", "--params-file", str(file)], **options))
    assert reason in str(refusal.value)
    assert str(refusal.value).startswith(f"{bench.namespace}/twist_mux: ")
    assert "\n" not in str(refusal.value)
