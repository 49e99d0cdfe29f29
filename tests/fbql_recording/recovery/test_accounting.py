"""What recovery says is lost is lost, and what it calls complete is complete (faults 72 and 73)."""

from __future__ import annotations

import os
import shutil
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from time import monotonic

import pytest
import yaml
from commands import recover as recover_command
from damaged_recordings import mcap_of, places_of, spoil
from fbql_common.core.errors import BadInput
from fbql_recording.mcap.reader import Message
from fbql_recording.mcap.writer import McapWriter, WriterChannel
from fbql_recording.recovery.recover import Recovery, recover
from fbql_recording.run import open_run
from mcap.opcode import Opcode
from mcap.writer import MCAP0_MAGIC
from mutated_recordings import STORED, Original, chunks_of, mutated, record_originals, untruths
from recorded_match import record_match

INPUTS = int(os.environ.get("FBQL_FUZZ_INPUTS", "60"))
"""How many damaged recordings are made of each seed recording."""
FIRST = int(os.environ.get("FBQL_FUZZ_FIRST", "0"))
SLOW_S = 60.0
"""Much longer than any recovery of these takes, on any machine [s]."""
OPTIONS = {"max_steps": 8, "episodes": 5, "controller": "subsumption"}


@pytest.fixture(autouse=True)
def no_sync(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing has to survive a power cut here."""
    monkeypatch.setattr(os, "fsync", lambda _: None)


@pytest.fixture(scope="module")
def originals(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Original]:
    return record_originals(tmp_path_factory.mktemp("originals"))


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A chunk for each of five episodes. Not to be changed."""
    return record_match(tmp_path_factory.mktemp("recorded") / "run", **OPTIONS)


def told(path: Path) -> list[Message]:
    """The messages but for their numbers, which a recording that is written anew may count anew."""
    return [message._replace(sequence=0) for message in open_run(path).messages()]


def lines_of(found: Recovery) -> str:
    return "\n".join(gap.why for _, gap in found.gaps)


def split(run: Path, parts: int, *, numbered_on: bool = True) -> list[str]:
    """Divides a recording into files of whole episodes, as a recorder with a size limit does; gives their names."""
    read = open_run(run)
    messages = list(read.messages())
    topics = list(read.topics.values())
    starts = [step.stamp_ns for step in read.steps() if step.step == 0]
    limits = [starts[number * len(starts) // parts] for number in range(parts)] + [2**63]
    names: list[str] = []
    mcap_of(run).unlink()
    for number in range(parts):
        names.append(f"run_{number}.mcap")
        with (run / names[-1]).open("wb") as file:
            channels = [WriterChannel(each.name, each.type_name, each.schema, each.metadata) for each in topics]
            writer = McapWriter(lambda data, file=file: file.write(data) and None, channels, 4096)
            if number == 0 or not numbered_on:
                writer.add_metadata("fbql", {"behaviors": " ".join(read.behaviors)})
            for message in messages:
                if limits[number] <= message.log_time_ns < limits[number + 1]:
                    place = next(i for i, topic in enumerate(topics) if topic.name == message.topic)
                    sequence = message.sequence if numbered_on else None
                    writer.add_message(place, message.data, message.log_time_ns, message.publish_time_ns, sequence)
            writer.finish()
    text = yaml.safe_load((run / "metadata.yaml").read_text())
    text["rosbag2_bagfile_information"]["relative_file_paths"] = names
    (run / "metadata.yaml").write_text(yaml.safe_dump(text))
    return names


@pytest.mark.parametrize("has_summary", [True, False])
@pytest.mark.parametrize("number", [0, 1, 2, 3])
def test_of_two_damaged_chunks_beside_each_other_every_message_is_counted(run, number, has_summary):
    before = told(run)
    for begin, end in places_of(mcap_of(run), Opcode.CHUNK)[number : number + 2]:
        spoil(mcap_of(run), begin + 3)
        spoil(mcap_of(run), (begin + end) // 2)
    if not has_summary:
        spoil(mcap_of(run), mcap_of(run).stat().st_size - 20)
    found = recover(run, None)
    lost = Counter(message.topic for message in (Counter(before) - Counter(told(found.path))).elements())
    assert found.messages_lost == dict(lost)
    assert found.is_exact
    assert lost.total() > 0


@pytest.mark.parametrize("numbered_on", [True, False])
def test_of_a_sound_split_recording_nothing_is_lost(run, numbered_on):
    before = told(run)
    split(run, 3, numbered_on=numbered_on)
    found = recover(run, None)
    assert (found.is_complete, found.messages_lost, lines_of(found)) == (True, {}, "")
    assert Counter(told(found.path)) == Counter(before)


@pytest.mark.parametrize("with_metadata", [True, False])
def test_of_a_split_recording_whose_summaries_are_damaged_nothing_is_lost_either(run, with_metadata):
    """Then the numbers of the messages alone say that one file continues another."""
    before = told(run)
    split(run, 3, numbered_on=True)
    for path in run.glob("*.mcap"):
        spoil(path, path.stat().st_size - len(MCAP0_MAGIC) - 2)  # in the summary's CRC
    if not with_metadata:
        (run / "metadata.yaml").unlink()
    found = recover(run, None)
    assert (found.is_complete, found.messages_lost) == (True, {})
    assert Counter(told(found.path)) == Counter(before)


@pytest.mark.parametrize("number", [0, 1, -1])
def test_times_are_told_only_where_head_and_indexes_agree(run, number):
    data = mcap_of(run).read_bytes()
    end_ns, before = open_run(run).end_ns, told(run)
    mcap_of(run).write_bytes(data[:-20])
    chunk, end = places_of(mcap_of(run), Opcode.CHUNK)[number]
    index = next(begin for begin, _ in places_of(mcap_of(run), Opcode.MESSAGE_INDEX) if begin > chunk)
    spoil(mcap_of(run), (chunk + end) // 2)
    for at, value in ((index + 15 + 6, b"\x20"), (chunk + 9 + 8 + 6, b"\x20")):
        spoil(mcap_of(run), at, value)
    found = recover(run, None)
    assert len(told(found.path)) < len(before), "a chunk is lost"
    assert found.gaps
    assert all(gap.end_ns is None or gap.end_ns <= end_ns for _, gap in found.gaps)


def test_what_is_not_known_is_not_told_as_a_number(run, capsys):
    """The last chunk is damaged in a file without an end, and nothing else tells how much there was."""
    data = mcap_of(run).read_bytes()
    alone = run.parent / "alone.mcap"
    begin, end = places_of(mcap_of(run), Opcode.CHUNK)[-1]
    alone.write_bytes(data[:end])
    spoil(alone, (begin + end) // 2)
    found = recover(alone, None)
    assert (found.is_exact, found.messages_lost) == (False, {})
    assert recover_command([str(alone)]) == 3
    assert "how many messages are lost is unknown" in capsys.readouterr().out


@pytest.mark.parametrize("stored", STORED)
@pytest.mark.parametrize("number", [0, 1, -1])
def test_a_damaged_chunk_is_lost_however_others_store_the_recording(originals, tmp_path, stored, number):
    """Without a summary, or with one that lists no messages: nothing in it tells that they were there."""
    original = originals[stored]
    path = tmp_path / "x.mcap"
    path.write_bytes(original.data)
    whole = recover(path, tmp_path / "whole")
    assert (whole.is_complete, whole.messages) == (True, len(original.messages))
    begin, end = places_of(path, Opcode.CHUNK)[number]
    spoil(path, (begin + end) // 2)
    found = recover(path, tmp_path / "out")
    assert not found.is_complete
    assert list(untruths(original, found)) == []


# What is complete


def _absent(run: Path, _: Path) -> str:
    (run / split(run, 3)[1]).unlink()
    return "is not there"


def _absent_unlisted(run: Path, other: Path) -> str:
    _absent(run, other)
    (run / "metadata.yaml").unlink()
    return "is not there"


def _relisted(run: Path, _: Path) -> str:
    names = split(run, 3)
    (run / names[1]).unlink()
    text = (run / "metadata.yaml").read_text().replace(f"  - {names[1]}\n", "")
    (run / "metadata.yaml").write_text(text)
    return "out of sequence"


def _relisted_and_numbered_anew(run: Path, _: Path) -> str:
    names = split(run, 3, numbered_on=False)
    (run / names[1]).unlink()
    text = (run / "metadata.yaml").read_text().replace(f"  - {names[1]}\n", "")
    (run / "metadata.yaml").write_text(text)
    return "out of sequence"


def _wrong_order(run: Path, _: Path) -> str:
    first, second = split(run, 2)
    text = (run / "metadata.yaml").read_text()
    text = text.replace(first, "?").replace(second, first).replace("?", second)
    (run / "metadata.yaml").write_text(text)
    return "out of sequence"


def _another_chunk(run: Path, other: Path) -> str:
    data, theirs = mcap_of(run).read_bytes(), mcap_of(other).read_bytes()
    (begin, end), (a, b) = chunks_of(data)[1], chunks_of(theirs)[1]
    mcap_of(run).write_bytes(data[:begin] + theirs[a:b] + data[end:])
    return "not a part of this recording"


def _another_appended(run: Path, other: Path) -> str:
    mcap_of(run).write_bytes(mcap_of(run).read_bytes() + mcap_of(other).read_bytes())
    return "another recording begins"


def _itself_appended(run: Path, _: Path) -> str:
    return _another_appended(run, run)


def _a_chunk_twice(run: Path, _: Path) -> str:
    data = mcap_of(run).read_bytes()
    begin, end = chunks_of(data)[1]
    mcap_of(run).write_bytes(data[:end] + data[begin:end] + data[end:])
    return "there already"


def _chunks_swapped(run: Path, _: Path) -> str:
    data = mcap_of(run).read_bytes()
    (a, b), (c, d) = chunks_of(data)[1:3]
    mcap_of(run).write_bytes(data[:a] + data[c:d] + data[b:c] + data[a:b] + data[d:])
    return "not in its place"


def _steps_left_out(run: Path, _: Path) -> str:
    """Every CRC and number is right, but two steps of the third episode are not there."""
    read = open_run(run)
    gone = {step.stamp_ns for step in read.steps() if step.episode == 2 and step.step in (4, 5)}
    messages, topics = [each for each in read.messages() if each.log_time_ns not in gone], list(read.topics.values())
    with mcap_of(run).open("wb") as file:
        channels = [WriterChannel(each.name, each.type_name, each.schema, each.metadata) for each in topics]
        writer = McapWriter(lambda data: file.write(data) and None, channels, 4096)
        for message in messages:
            place = next(i for i, topic in enumerate(topics) if topic.name == message.topic)
            writer.add_message(place, message.data, message.log_time_ns)
        writer.finish()
    (run / "metadata.yaml").unlink()
    return "episode 2, step 6 follows episode 2, step 3, out of sequence"


CHANGES = (
    *(_absent, _absent_unlisted, _relisted, _relisted_and_numbered_anew, _wrong_order, _another_chunk),
    *(_another_appended, _itself_appended, _a_chunk_twice, _chunks_swapped, _steps_left_out),
)


@pytest.mark.parametrize("change", CHANGES, ids=lambda change: change.__name__.lstrip("_"))
def test_what_is_not_as_it_was_recorded_is_incomplete(run, tmp_path, capsys, change: Callable[[Path, Path], str]):
    before = told(run)
    other = record_match(tmp_path / "other", **{**OPTIONS, "seed": 4, "max_steps": 11})
    why = change(run, other)
    found = recover(run, None)
    assert not found.is_complete
    assert why in lines_of(found)
    after = told(found.path)
    assert not Counter(after) - Counter(before)
    lost = len(before) - len(after)
    assert sum(found.messages_lost.values()) <= lost
    assert not found.is_exact or sum(found.messages_lost.values()) == lost
    assert recover_command([str(run)]) == 3
    assert why in capsys.readouterr().out


def test_steps_that_never_arrived_are_no_damage(tmp_path):
    """Fusion knew of them, and plays on."""
    run = record_match(tmp_path / "run", restart_at={1: (3, 5)}, **OPTIONS)
    assert recover(run, None).is_complete


# Damage at random


def judge(originals: dict[str, Original], seed: int, place: Path) -> str:
    """Recovers damaged recordings of a seed; gives what is wrong with what recovery says, or "".

    Of the ways in which others store a recording each seed takes one.
    """
    stored = list(STORED)[seed % len(STORED)]
    for name, original in originals.items():
        if name in STORED and name != stored:
            continue
        what, data = mutated(seed, original)
        path = place / f"{seed}_{name}" / "run_0.mcap"
        path.parent.mkdir()
        path.write_bytes(data)
        begun_s = monotonic()
        try:
            wrong = list(untruths(original, recover(path, path.parent / "out")))
        except BadInput as error:
            wrong = ["more than one line"] if "\n" in str(error) else []
        if monotonic() - begun_s > SLOW_S:
            wrong.append(f"took {monotonic() - begun_s:.0f} s")
        shutil.rmtree(path.parent)
        if wrong:
            return f"seed {seed}, {name}: {what}: {'; '.join(wrong[:3])}"
    return ""


def test_what_recovery_says_of_damage_at_random_is_true(originals, tmp_path):
    """FBQL_FUZZ_INPUTS sets how many, FBQL_FUZZ_FIRST the first seed."""
    wrong = [line for seed in range(FIRST, FIRST + INPUTS) if (line := judge(originals, seed, tmp_path))]
    assert not wrong, "\n".join(wrong)


@pytest.mark.long
@pytest.mark.timeout(0)
def test_what_recovery_says_of_much_damage_is_true(originals, tmp_path):
    wrong = [line for seed in range(100_000, 105_000) if (line := judge(originals, seed, tmp_path))]
    assert not wrong, "\n".join(wrong)
