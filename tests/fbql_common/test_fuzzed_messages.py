"""Whatever bytes arrive on a topic of ours: a message with values that can be used, or rejected with the reason."""

from __future__ import annotations

import random
from collections.abc import Callable
from math import isfinite
from typing import Any

import numpy as np
import pytest
from fbql_common.core.errors import BadInput
from fbql_common.core.types import BehaviorOutput, Decision, WheelCommand, World
from fbql_common.wire import (
    MESSAGES,
    Rejected,
    decode_command,
    decode_decision,
    decode_output,
    decode_world,
    encode_command,
    encode_decision,
    encode_output,
    encode_world,
)
from fbql_fusion.core.assembly import StepAssembly
from fbql_fusion.core.parameters import FusionParameters
from fbql_fusion.core.soccer_session import SoccerSession
from fbql_sim.core.world_loop import WorldLoop
from fuzzing import dice, odd_bytes, odd_number
from hand_driven import BEHAVIORS, output_to, world_at
from mcap_contents import odd_cdr
from rclpy.serialization import deserialize_message

WORLD = world_at(3, 4)
SOUND: dict[type[Any], tuple[Callable[[Any], bytes], Callable[[bytes], Any], Any]] = {
    World: (encode_world, decode_world, WORLD),
    BehaviorOutput: (encode_output, decode_output, output_to(WORLD, 1)),
    WheelCommand: (encode_command, decode_command, WheelCommand(*WORLD[:3], 1.0, -2.0)),
    Decision: (
        encode_decision,
        decode_decision,
        Decision(*WORLD[:3], "fbql", 1, BEHAVIORS, (0, 1, 2), (0.5,) * 3, (0.2, 0.3, 0.5), 1, -5.0, False, (0.1,) * 3),
    ),
}


@pytest.mark.parametrize("kind", SOUND)
def test_any_bytes_are_the_message_that_the_middleware_reads_or_rejected(kind):
    encode, decode, value = SOUND[kind]
    for rng in dice(300):
        data = encode(value)
        for _ in range(rng.choice((1, 1, 3))):
            data = odd_cdr(rng, data) if rng.random() < 0.7 else odd_bytes(data, rng)
        try:
            found = decode(data)
        except Rejected as reason:
            assert str(reason)
            continue
        assert type(found) is kind
        again = decode(encode(found))
        assert repr(again) == repr(found)
        if kind is not Decision:
            assert all(isfinite(each) for each in found if isinstance(each, float))
        message = deserialize_message(data, MESSAGES[kind])
        assert message.header.stamp.sec * 10**9 + message.header.stamp.nanosec == found.stamp_ns
        for name, ours in zip(found._fields[1:], found[1:], strict=True):
            theirs = getattr(message, name)
            theirs = (
                tuple(theirs.tolist() if isinstance(theirs, np.ndarray) else theirs) if type(ours) is tuple else theirs
            )
            assert repr(theirs) == repr(ours), name


def odd[V: World | BehaviorOutput](value: V, rng: random.Random) -> V:
    """The message with a field that is odd but has its type."""
    name = rng.choice(value._fields)
    field = getattr(value, name)
    numbers = (0.0, 1e308, -1e308, 1e-308, 0.3, -7.0, 1e6)
    if isinstance(field, bool):
        return value._replace(**{name: not field})
    if isinstance(field, int):
        return value._replace(
            **{name: rng.choice((field + 1, field - 1, 0, max(-(2**63), min(odd_number(rng), 2**63 - 1))))}
        )
    if isinstance(field, float):
        return value._replace(**{name: rng.choice(numbers)})
    if isinstance(field, tuple):
        return value._replace(**{name: rng.choice(((), field * 3, tuple(rng.choice(numbers) for _ in field)))})
    return value._replace(**{name: rng.choice(("", "\x1b[31m", "é" * 50, "x" * 300))})


def test_any_valid_messages_in_any_order_are_decided_with_finite_commands():
    """What comes through the wire, through the assembly of steps and the session, as in the fusion node."""
    for rng in dice(12):
        controller = rng.choice(("subsumption", "uniform", "fbql_literal", "fbql"))
        session = SoccerSession(FusionParameters(controller=controller, episodes=2, guided=rng.randrange(2), seed=1))
        assembly = StepAssembly(BEHAVIORS)
        begun = session.next_episode()
        assert begun is not None
        assembly.begin(begun[0])
        loop = WorldLoop()
        world = loop.reset(*begun)
        command = WheelCommand(*world[:3], 0.0, 0.0)
        for _ in range(40):
            messages: list[Any] = [world, *(output_to(world, index) for index in range(3))]
            messages = [odd(each, rng) if rng.random() < 0.15 else each for each in messages]
            messages += [rng.choice(messages) for _ in range(rng.randrange(2))]
            rng.shuffle(messages)
            for message in messages:
                encode, decode, _ = SOUND[type(message)]
                try:
                    data = encode(message)
                    heard = decode(data)
                except (Rejected, TypeError):
                    continue
                if isinstance(heard, World):
                    assembly.add_world(heard, data)
                else:
                    assembly.add_output(rng.randrange(3) if rng.random() < 0.1 else BEHAVIORS.index(heard.name)
                                        if heard.name in BEHAVIORS else 0, heard, data)  # fmt: skip
                step = assembly.complete()
                if step is None or step.world is None:
                    continue
                try:
                    command, decision = session.decide(step.world, step.outputs)
                except BadInput as refusal:
                    assert str(refusal).isprintable()
                    return
                assert isfinite(command.left_rad_s) and isfinite(command.right_rad_s), decision
                assert all(map(isfinite, decision.weights)), decision
                encode_command(command), encode_decision(decision)
                assembly.decided(step)
                if step.world.ended:
                    if (begun := session.next_episode()) is None:
                        break
                    assembly.begin(begun[0])
                    world = loop.reset(*begun)
            if begun is None:
                break
            if rng.random() < 0.2:
                assembly.drop_missing()
            if not world.ended:
                world = loop.step(command.left_rad_s, command.right_rad_s)
