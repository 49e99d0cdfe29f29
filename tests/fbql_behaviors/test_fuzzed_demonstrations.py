"""Whatever a recording of demonstrations holds: its patterns are found, or it is refused in one line."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from fbql.demonstrations.origins import merge
from fbql.demonstrations.replay import verify
from fbql_behaviors.core.observation import observation_of
from fbql_behaviors.core.patterns import Patterns, patterns_of
from fbql_behaviors.demonstration_storage import load_demonstrations, load_recordings
from fbql_common.core.types import WheelCommand, World
from fbql_recording.message_definitions import step_messages
from fuzzing import dice, odd_bytes, odd_copy, read_or_refused
from mcap.writer import CompressionType, Writer

BEHAVIOR = "ball_seeking"
STEPS = 12
Change = Callable[[list[float]], list[float]]


def write(
    path: Path, compression: CompressionType, about: dict[str, str], change: Change = lambda numbers: numbers
) -> Path:
    """Records one short demonstration; `change` may change the numbers of a message."""
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=500, compression=compression, enable_data_crcs=True)
        writer.start("ros2", "somebody")
        writer.add_metadata("fbql", {"behavior": BEHAVIOR, **about})
        channels = {}
        for kind, topic in ((World, "/world"), (WheelCommand, "/wheel_command")):
            definition = step_messages()[kind]
            schema = writer.register_schema(definition.type_name, "ros2msg", definition.schema_text.encode())
            channels[kind] = writer.register_channel(topic, "cdr", schema)
        for step in range(STEPS):
            numbers = (10**9 + step * 10**7, 0, step)
            for value in (
                World(*numbers, *change([0.1 * (step + 1)] * 12), *[False] * 6),
                WheelCommand(*numbers, *change([1.0, 2.0])),
            ):
                data = step_messages()[type(value)].codec.encode(value)
                writer.add_message(channels[type(value)], numbers[0], data, numbers[0])
        writer.finish()
    return path


def patterns_in(path: Path) -> Patterns:
    return patterns_of(load_demonstrations(path, BEHAVIOR), observation_of(BEHAVIOR))


@pytest.mark.parametrize("compression", CompressionType)
def test_mutated_bytes_are_read_or_refused(tmp_path, compression):
    path = write(tmp_path / "x.mcap", compression, {})
    data = path.read_bytes()
    sound = load_demonstrations(path, BEHAVIOR)
    for rng in dice(120):
        path.write_bytes(odd_bytes(data, rng))
        found = read_or_refused(lambda: load_demonstrations(path, BEHAVIOR))
        assert found is None or found == sound
        read_or_refused(lambda: patterns_in(path))


def test_every_flipped_byte_of_a_recording_is_noticed(tmp_path):
    path = write(tmp_path / "x.mcap", CompressionType.LZ4, {})
    data = path.read_bytes()
    sound = load_demonstrations(path, BEHAVIOR)
    for at in range(0, len(data), 7):
        path.write_bytes(data[:at] + bytes([data[at] ^ 0xFF]) + data[at + 1 :])
        found = read_or_refused(lambda: load_demonstrations(path, BEHAVIOR))
        assert found is None or found == sound


def test_hostile_numbers_are_patterns_or_refused(tmp_path):
    numbers = (0.0, -0.0, 1e-308, 1e5, -1e6, 1e7, 1e200, 1e308, -1e308, float("nan"), float("inf"))
    for rng in dice(60):

        def change(values: list[float], rng=rng) -> list[float]:
            return [rng.choice(numbers) if rng.random() < 0.1 else value for value in values]

        path = write(tmp_path / "x.mcap", CompressionType.NONE, {}, change)
        read_or_refused(lambda path=path: patterns_in(path))


def test_hostile_descriptions_are_read_or_refused(tmp_path):
    origin = {"instructor": "scripted", "simulation": {"dt_s": 0.02}, "episode_seeds": {"0": 1}, "details": {}}
    for rng in dice(60):
        text = json.dumps(odd_copy([origin], rng))
        if rng.random() < 0.3:
            text = odd_bytes(text.encode(), rng, b"[" * 5000).decode(errors="replace")
        path = write(tmp_path / "x.mcap", CompressionType.NONE, {"origins": text, "\x1b": "\n"})
        read_or_refused(lambda path=path: verify(list(load_recordings(path))))
        read_or_refused(lambda path=path: merge(list(load_recordings(path))))
