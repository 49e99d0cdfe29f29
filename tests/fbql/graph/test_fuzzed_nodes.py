"""Whatever arrives at a node while it runs: it keeps running, and reports in one line what it drops."""

from __future__ import annotations

import random
from math import isfinite
from typing import Any

import pytest
from fbql_behaviors.behavior_node import BehaviorNode
from fbql_common.core.topic_names import DECISION, WHEEL_COMMAND, WORLD, behavior_topic
from fbql_common.core.types import BehaviorOutput, Decision, WheelCommand, World
from fbql_common.qos import STEP_QOS
from fbql_common.wire import MESSAGES, encode_command, encode_output, encode_world
from fbql_fusion.fusion_node import FusionNode
from fbql_msgs.srv import ResetEpisode, SavePolicy
from fbql_sim.simulator_node import SimulatorNode
from fuzzing import dice, odd_bytes, odd_number, odd_word
from hand_driven import FakeBehavior, FakeSimulator, Partner, listen, output_to, world_at
from mcap_contents import odd_cdr
from rclpy.exceptions import ParameterNotDeclaredException
from rclpy.parameter import Parameter

ROUND = 30
"""Inputs between two sound messages."""


def odd_data(rng: random.Random, data: bytes) -> bytes:
    return odd_cdr(rng, data) if rng.random() < 0.7 else odd_bytes(data, rng)


def set_parameters(node: Any, rng: random.Random) -> None:
    """Parameters are set at run time, as `ros2 param set` does; each is refused, because all are read-only."""
    names = [*node._parameters, odd_word(rng) or "x"]  # rclpy takes one without a name
    values = (True, 1, odd_number(rng) % 2**63, 0.5, float("nan"), "x", "\x1b", [1, 2], ["a"], [0.5], [True], b"")
    name = rng.choice([name for name in names if name != "use_sim_time"])
    before = dict(node._parameters)
    try:
        [result] = node.set_parameters([Parameter(name, value=rng.choice(values))])
    except (ParameterNotDeclaredException, TypeError):
        return
    assert not result.successful or node._parameters == before, name


def check_log(said: str) -> None:
    assert "Traceback" not in said
    assert all(line.isprintable() for line in said.splitlines()), said


def test_a_behavior_answers_the_next_sound_world_whatever_came_before(bench):
    node = bench.add(BehaviorNode, "approaching")
    partner = bench.add(Partner)
    answers = listen(partner, BehaviorOutput, behavior_topic("approaching"))
    publisher = partner.create_publisher(MESSAGES[World], WORLD, STEP_QOS)
    bench.until(lambda: publisher.get_subscription_count() == 1, "the behavior to subscribe world")
    bench.until(lambda: node.count_subscribers(behavior_topic("approaching")) == 1, "the answers to be heard")
    stamp_ns = 0
    for number, rng in enumerate(dice(60)):
        world = world_at(0, number, stamp_ns)
        publisher.publish(odd_data(rng, encode_world(world)))
        set_parameters(node, rng)
        if number % ROUND == ROUND - 1:
            count = len(answers)
            sound = world_at(number, 0, number + 1)  # an episode's first is never too old
            publisher.publish(encode_world(sound))
            bench.until(lambda n=number: any(a[1:3] == (n, 0) for a in answers), "the answer to a sound world")
            assert all(isfinite(each.left_rad_s + each.right_rad_s) for each in answers[count:])
    assert not node.finished.done()
    check_log(bench.said())


@pytest.mark.parametrize("realtime", [0.0, 1.0])
def test_a_simulator_takes_the_next_sound_command_whatever_came_before(bench, realtime):
    node = bench.add(SimulatorNode, request_period_s=0.05, realtime=realtime)
    partner = bench.add(Partner)
    worlds = listen(partner, World, WORLD)
    publisher = partner.create_publisher(MESSAGES[WheelCommand], WHEEL_COMMAND, STEP_QOS)
    bench.until(lambda: publisher.get_subscription_count() == 1 and worlds, "the simulator")
    for number, rng in enumerate(dice(60)):
        world = worlds[-1]
        command = encode_command(WheelCommand(*world[:3], rng.choice((0.0, 1e308, -1e308, 1e-308, 5.0)), 1.0))
        publisher.publish(odd_data(rng, command))
        set_parameters(node, rng)
        if rng.random() < 0.1:
            big = [max(-(2**63), min(odd_number(rng), 2**63 - 1)) for _ in range(2)]
            bench.call(partner, ResetEpisode, "simulator/reset_episode", episode=big[0], seed=big[1])
        if number % ROUND == ROUND - 1:
            bench.call(partner, ResetEpisode, "simulator/reset_episode", episode=number, seed=1)
            bench.until(lambda n=number: worlds[-1].episode == n, "the episode's first world")
            first = worlds[-1]
            publisher.publish(encode_command(WheelCommand(*first[:3], 5.0, 5.0)))
            bench.until(lambda w=first: worlds[-1].step > w.step, "the next step")
            assert all(isfinite(each) for world in worlds for each in world if isinstance(each, float))
    assert not node.finished.done()
    check_log(bench.said())


def test_fusion_goes_on_whatever_comes(bench, tmp_path, monkeypatch):
    (tmp_path / "cwd").mkdir()
    monkeypatch.chdir(tmp_path / "cwd")  # policies are saved under odd names, ../x among them
    simulator = bench.add(FakeSimulator)
    behaviors = [bench.add(FakeBehavior, index) for index in range(3)]
    partner = bench.add(Partner)
    decisions = listen(partner, Decision, DECISION)
    node = bench.add(
        FusionNode, run_directory=str(tmp_path / "run"), behavior_timeout_s=0.0, world_timeout_s=60.0, controller="fbql_literal",
        guided=0,
    )  # fmt: skip
    bench.until(lambda: decisions, "the first decision")
    for number, rng in enumerate(dice(60)):
        near = world_at(0, number + 1, simulator.stamp_ns + rng.choice((0, 1, 10**7, 10**12)))
        if rng.random() < 0.5:
            simulator.publisher.publish(odd_data(rng, encode_world(near)))
        else:
            index = rng.randrange(3)
            behaviors[index].publisher.publish(odd_data(rng, encode_output(output_to(near, rng.randrange(3)))))
        set_parameters(node, rng)
        if rng.random() < 0.1:
            path = rng.choice(("", "/proc/x", "/dev/null/x", odd_word(rng).replace("\0", ""), str(tmp_path / "p.npz")))
            bench.call(partner, SavePolicy, "fusion/save_policy", path=path)
    answer = bench.call(partner, SavePolicy, "fusion/save_policy", path=str(tmp_path / "policy.npz"))
    assert answer.success and not node.finished.done(), "it still serves"
    assert all(isfinite(weight) for each in decisions for weight in each.weights)
    check_log(bench.said())
