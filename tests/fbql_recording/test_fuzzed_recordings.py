"""Whatever a recording holds: what is read was recorded, what is missing is said, or it is refused in one line."""

from __future__ import annotations

import os
import shutil
from collections import Counter
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pytest
import yaml
from damaged_recordings import mcap_of, records_of
from fbql_common.core.errors import BadInput
from fbql_recording.mcap.reader import Message
from fbql_recording.recovery.recover import recover
from fbql_recording.run import Run, open_run
from foreign_recording import ForeignTopic, with_foreign_topics
from fuzzing import dice, odd_bytes, odd_copy, odd_value, read_or_refused
from mcap.writer import MCAP0_MAGIC
from mcap_contents import Contents, bytes_of, contents_of, messages_of, odd_contents
from recorded_match import record_match


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two episodes of seven steps. Not to be changed."""
    return record_match(tmp_path_factory.mktemp("recorded") / "run", max_steps=6, episodes=2)


def everything(path: Path, skip_corrupt: bool) -> tuple[Run, list[Any]]:
    run = open_run(path, skip_corrupt=skip_corrupt)
    messages = list(run.messages())
    for _ in run.steps():
        pass
    run.episodes()
    assert all(isinstance(line, str) for line in run.warnings)
    return run, messages


def test_mutated_bytes_are_read_refused_or_said_to_be_lost(recorded, place):
    data = mcap_of(recorded).read_bytes()
    records = list(records_of(data))
    whole = list(open_run(recorded).messages())
    path = place / "x.mcap"
    for rng in dice(150):
        if rng.random() < 0.3:  # whole records removed, doubled or in another order
            parts = [data[record.begin : record.end] for record in records]
            first, second = rng.randrange(len(parts)), rng.randrange(len(parts))
            parts[first:second] = rng.choice(([], parts[first:second] * 2, [parts[second]]))
            odd = MCAP0_MAGIC + b"".join(parts) + rng.choice((MCAP0_MAGIC, b""))
        else:
            odd = odd_bytes(data, rng)
        path.write_bytes(odd)
        skip_corrupt = rng.random() < 0.5
        found = read_or_refused(lambda skip=skip_corrupt: everything(path, skip))
        if found is not None and odd != data:
            run, messages = found
            assert (
                not run.is_complete or run.warnings or len(messages) >= len(whole) or messages == whole[: len(messages)]
            )


def test_mutated_metadata_and_configuration_are_read_or_refused(recorded, place):
    run = Path(shutil.copytree(recorded, place / "run"))
    texts = {
        name: (run / name).read_bytes() for name in ("metadata.yaml", "config.yaml", "episodes.csv", "summary.json")
    }
    alone = mcap_of(run).read_bytes()
    for rng in dice(60):
        name = rng.choice(list(texts))
        if name.endswith(".yaml") and rng.random() < 0.6:
            odd = yaml.safe_dump(odd_copy(yaml.safe_load(texts[name]), rng)).encode()
        else:
            odd = odd_bytes(texts[name], rng)
        (run / name).write_bytes(odd)
        mcap = run / "run_0.mcap"
        if name != "metadata.yaml":  # the recording's own copies come first: they are renamed
            mcap.write_bytes(alone.replace(name.encode(), name.encode()[::-1]))
        read_or_refused(lambda: (everything(run, True), open_run(run, skip_corrupt=True).summary))
        (run / name).write_bytes(texts[name])
        mcap.write_bytes(alone)


def test_odd_topics_beside_ours_change_nothing_of_ours(recorded, place):
    steps = list(open_run(recorded).steps())
    types = ("fbql_msgs/msg/WorldState", "fbql_msgs/msg/WheelCommand", "std_msgs/msg/String", "", "a/b", "this/msg/Zen")
    for rng in dice(40):
        schema = open_run(recorded).topics["/world"].schema.encode()
        topic = ForeignTopic(
            rng.choice(("/text", "/world", "/wheel_command", "", "a\nb", "/behaviors/x")),
            rng.choice(types),
            rng.choice(("ros2msg", "ros2idl", "protobuf", "jsonschema", "")),
            rng.choice((b"", rng.randbytes(20), odd_bytes(schema, rng))),
            rng.choice(("json", "protobuf", "", "ros1")),
            rng.randbytes(rng.randrange(50)),
            {"offered_qos_profiles": str(odd_value(rng))},
            rng.choice((None, 0, 2**64 - 1)),
        )
        path = with_foreign_topics(recorded, place / "x.mcap", [topic])
        try:
            assert list(open_run(path).steps()) == steps
        except BadInput as error:
            assert "is not a text" in str(error) or "behaviors" in str(error)


def recorded_in(contents: Contents) -> list[tuple[int, int, bytes]]:
    """Every message but for its sequence, which recovery may count anew."""
    return [(each.log_time, each.publish_time, each.data) for each in messages_of(contents)]


def told_in(messages: Iterable[Message]) -> list[tuple[int, int, bytes]]:
    return [(each.log_time_ns, each.publish_time_ns, each.data) for each in messages]


@pytest.fixture(scope="module")
def contents(recorded: Path) -> Contents:
    return contents_of(mcap_of(recorded).read_bytes())


def test_a_file_put_together_again_is_as_it_was(recorded, contents, place):
    path = place / "x.mcap"
    path.write_bytes(bytes_of(contents))
    run, messages = everything(path, skip_corrupt=False)
    assert messages == list(open_run(recorded).messages())
    assert (run.is_complete, run.warnings) == (True, [])


def test_whatever_a_sound_file_says_is_read_whole_or_reported_as_left_out(contents, place):
    path = place / "x.mcap"
    for number, rng in enumerate(dice(100)):
        names, odd, data = odd_contents(contents, rng)
        path.write_bytes(data)
        skip_corrupt = rng.random() < 0.5
        found = read_or_refused(lambda skip=skip_corrupt: everything(path, skip))
        if found is not None:
            run, messages = found
            if run.is_complete and not run.warnings:
                assert told_in(messages) == recorded_in(odd), (number, names)


def test_whatever_a_sound_file_says_is_recovered_whole_or_reported_as_lost(contents, place, monkeypatch):
    monkeypatch.setattr(os, "fsync", lambda _: None)
    path = place / "x.mcap"
    for number, rng in enumerate(dice(60)):
        names, odd, data = odd_contents(contents, rng)
        path.write_bytes(data)
        found = read_or_refused(lambda: recover(path, place / "out"))
        if found is not None:
            told = Counter(recorded_in(contents_of(mcap_of(found.path).read_bytes())))
            there = Counter(recorded_in(odd))
            assert not told - there, (number, names)
            assert not found.is_complete or told == there, (number, names)
            assert found.messages == told.total(), (number, names)
        shutil.rmtree(place / "out", ignore_errors=True)
