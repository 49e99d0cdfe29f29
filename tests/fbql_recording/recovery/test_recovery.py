"""Recovery: what is lost is told to the message, and what is written is a recording that others read to its end."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
import yaml
from damaged_recordings import attachment, mcap_of, places_of, spoil
from fbql_recording.recovery.recover import Recovery, recover
from fbql_recording.run import open_run
from fuzzing import bounded
from javascript_reader import read_with_javascript
from mcap.opcode import Opcode
from mcap.records import AttachmentIndex, Metadata
from mcap.writer import CompressionType, Writer
from mcap_contents import bytes_of, contents_of
from recorded_match import digest_of, record_match
from rosbags.highlevel import AnyReader
from run_directory_reader import finalised
from verified_run import verification_of

LEARNING = {"controller": "fbql_literal", "guided": 1, "tie_rule": "first", "max_steps": 300}


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """More than four chunks. Not to be changed."""
    return record_match(tmp_path_factory.mktemp("recorded") / "run", **LEARNING)


@pytest.fixture
def killed(tmp_path: Path) -> Path:
    """What SIGKILL leaves."""
    return record_match(tmp_path / "run", close=False, **LEARNING)


def spoil_chunk(run: Path, number: int) -> None:
    begin, end = places_of(mcap_of(run), Opcode.CHUNK)[number]
    spoil(mcap_of(run), (begin + end) // 2)


def recovered(run: Path) -> Recovery:
    return recover(run, None, lambda _: None)


def rosbags_reads(run: Path) -> list[tuple[str, int, bytes]]:
    with AnyReader([run]) as reader:
        found = [(connection.topic, time_ns, bytes(data)) for connection, time_ns, data in reader.messages()]
        assert len(found) == reader.message_count
    return found


@pytest.mark.parametrize("number", [0, 1, -1])
def test_of_a_damaged_chunk_every_message_is_accounted_for(run, number):
    before = {(message.topic, message.sequence): message for message in open_run(run).messages()}
    spoil_chunk(run, number)
    found = recovered(run)
    after = {(message.topic, message.sequence): message for message in open_run(found.path).messages()}
    missing = {key: message for key, message in before.items() if key not in after}
    assert all(before[key] == message for key, message in after.items())
    assert (found.chunks_lost, found.is_complete) == (1, False)
    assert sum(found.messages_lost.values()) == len(missing) > 0
    assert found.messages == len(after)
    ((_, loss),) = found.gaps
    times = [message.log_time_ns for message in missing.values()]
    assert (loss.start_ns, loss.end_ns) == (min(times), max(times))
    assert found.steps == len({message.log_time_ns for message in after.values()})


def test_without_its_summary_the_index_and_the_numbers_tell_the_same_of_two_neighbours(run):
    spoil_chunk(run, 1)
    spoil_chunk(run, 2)
    told = recovered(run).messages_lost
    spoil(mcap_of(run), mcap_of(run).stat().st_size - 20)
    (run / "metadata.yaml").unlink()
    assert recovered(run).messages_lost == told
    for begin, end in reversed(places_of(mcap_of(run), Opcode.MESSAGE_INDEX)):
        data = mcap_of(run).read_bytes()
        mcap_of(run).write_bytes(data[:begin] + data[end:])
    assert recovered(run).messages_lost == told


def test_a_verified_replay_of_a_recovered_run_goes_on_to_the_gap(run):
    steps = [step.stamp_ns for step in open_run(run).steps()]
    spoil_chunk(run, 1)
    found = recovered(run)
    ((_, loss),) = found.gaps
    verified = verification_of(found.path)
    assert verified.difference is None
    assert verified.steps + verified.unfinished == sum(stamp <= loss.start_ns for stamp in steps) > 0
    assert verified.gap is not None
    gaps = [step.stamp_ns for step in open_run(found.path).steps() if step.after_gap]
    # The step that the end of the chunk cut in two is there in part.
    assert gaps in ([loss.end_ns], [min(stamp for stamp in steps if stamp > loss.end_ns)])


def test_readers_of_others_read_a_recovered_recording_to_its_end(run):
    spoil_chunk(run, 1)
    found = recovered(run)
    assert finalised(found.path) == found.messages
    ours = [(message.topic, message.log_time_ns, message.data) for message in open_run(found.path).messages()]
    assert sorted(rosbags_reads(found.path)) == sorted(ours)
    read = read_with_javascript(mcap_of(found.path))
    assert read["profile"] == "ros2"
    assert read["streamed"] == read["indexed"] == found.messages


def test_a_file_that_was_cut_off_lacks_what_metadata_yaml_tells(run):
    (_, middle), *_ = places_of(mcap_of(run), Opcode.CHUNK)[2:]
    mcap_of(run).write_bytes(mcap_of(run).read_bytes()[: middle - 1])
    recorded = yaml.safe_load((run / "metadata.yaml").read_text())["rosbag2_bagfile_information"]["message_count"]
    found = recovered(run)
    assert found.messages + sum(found.messages_lost.values()) == recorded
    assert found.cut_off == ["run_0.mcap"]
    assert json.loads((found.path / "summary.json").read_text())["incomplete"] is True


def test_a_killed_run_gets_its_end_and_its_result(killed, tmp_path):
    """Fault 46."""
    found = recovered(killed)
    assert (found.messages, found.steps, found.chunks_lost) == (6 * found.steps, found.steps, 0)
    assert not found.is_complete
    whole = record_match(tmp_path / "whole", **LEARNING)
    summary = json.loads((found.path / "summary.json").read_text())
    expected = json.loads((whole / "summary.json").read_text())
    for name in ("wall_s", "steps_per_s", "incomplete"):
        del summary[name], expected[name]
    assert summary == expected
    verified = verification_of(found.path)
    assert (verified.steps, verified.difference, verified.digest) == (found.steps, None, digest_of(whole))
    assert open_run(found.path).warnings == [f"{found.path}: recovered; lost: what came after the end of the file"]
    assert [episode.seed for episode in open_run(found.path).episodes()] == [
        episode.seed for episode in open_run(whole).episodes()
    ]


def test_nothing_is_lost_where_what_is_damaged_is_there_twice(run):
    for at in (3, places_of(mcap_of(run), Opcode.CHANNEL)[0][0] + 20, mcap_of(run).stat().st_size - 3):
        spoil(mcap_of(run), at)
    found = recovered(run)
    assert found.is_complete
    assert len(found.notes) == 3
    original = open_run(run.parent / "run_recovered")
    assert original.is_complete
    assert original.warnings == []
    assert verification_of(found.path).digest == digest_of(run)


def test_of_a_chunk_that_is_there_twice_in_a_killed_run_one_is_kept(killed, tmp_path):
    whole = recover(killed, tmp_path / "whole", lambda _: None)
    path = mcap_of(killed)
    (begin, end), data = places_of(path, Opcode.CHUNK)[1], path.read_bytes()
    path.write_bytes(data[:end] + data[begin:end] + data[end:])
    found = recovered(killed)
    assert list(open_run(found.path).messages()) == list(open_run(whole.path).messages())
    words = f"the chunk at byte {end} is a copy of the one at byte {begin}; it is left out"
    assert words in [gap.why for _, gap in found.gaps]


def test_a_damaged_attachment_is_taken_from_beside_the_recording(run):
    begin, end = places_of(mcap_of(run), Opcode.ATTACHMENT)[1]
    spoil(mcap_of(run), (begin + end) // 2)
    trees = open_run(run, skip_corrupt=True).attachments
    lacking = next(
        f"trees/{name}.json" for name in open_run(run, skip_corrupt=True).behaviors if f"trees/{name}.json" not in trees
    )
    found = recovered(run)
    assert found.is_complete
    assert open_run(found.path).attachments[lacking] == (run / lacking).read_bytes()
    (run / lacking).unlink()
    alone = recovered(run)
    assert alone.attachments_lost == [lacking]
    assert not alone.is_complete


def test_what_was_lost_once_stays_lost(run):
    spoil_chunk(run, 1)
    once = recovered(run)
    twice = recover(once.path, run.parent / "twice", lambda _: None)
    assert twice.lost_before == [once.lost_words]
    assert not twice.is_complete
    assert twice.messages == once.messages
    assert not open_run(twice.path).is_complete
    assert sum(step.after_gap for step in open_run(twice.path).steps()) == 1


def test_files_of_a_split_bag_become_one(run):
    shutil.copyfile(mcap_of(run), run / "run_1.mcap")
    (run / "metadata.yaml").write_text("{")
    (begin, _), *_ = places_of(run / "run_0.mcap", Opcode.CHUNK)[3:]
    (run / "run_0.mcap").write_bytes((run / "run_0.mcap").read_bytes()[:begin])
    found = recovered(run)
    read = open_run(found.path)
    parts = [sum(open_run(run / name).counts.values()) for name in ("run_0.mcap", "run_1.mcap")]
    assert sum(read.counts.values()) == found.messages == sum(parts)
    assert len(read.topics) == 6
    assert sum(step.after_gap for step in read.steps()) == 1


PROFILES_IN_NUMBERS = """
- {history: 1, depth: 5, reliability: 2, durability: 2, deadline: &endless {sec: 2147483647, nsec: 4294967295},
   lifespan: *endless, liveliness: 1, liveliness_lease_duration: *endless, avoid_ros_namespace_conventions: false}
- {history: 3, depth: 0, reliability: 1, durability: 1, deadline: *endless,
   lifespan: *endless, liveliness: 1, liveliness_lease_duration: *endless, avoid_ros_namespace_conventions: false}
"""
"""How rosbag2 wrote the quality of service before Jazzy: of two publishers."""


def recorded_by_others(
    path: Path, *, is_chunked: bool = True, compression: CompressionType = CompressionType.LZ4
) -> int:
    """Two topics with times and numbers of their own, schemas inside of the chunks; gives how many messages."""
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=500, use_chunking=is_chunked, compression=compression, enable_data_crcs=True)
        writer.start("ros2", "others")
        schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data\n")
        qos = {"/a": {}, "/b": {"offered_qos_profiles": PROFILES_IN_NUMBERS, "x": "y"}}
        channels = [writer.register_channel(topic, "cdr", schema, metadata) for topic, metadata in qos.items()]
        for number in range(100):
            data = b"\x00\x01\x00\x00\x03\x00\x00\x00ab\x00"
            writer.add_message(channels[number % 2], 1000 - number, data, 2000 + number, number * 7 % 5)
        writer.add_attachment(1, 2, "notes", "text/plain", b"x")
        writer.add_metadata("of others", {"k": "v"})
        writer.finish()
    return 100


@pytest.mark.parametrize("compression", CompressionType)
def test_recordings_of_others_keep_what_is_theirs(tmp_path, compression):
    path = tmp_path / "bag.mcap"
    recorded_by_others(path, compression=compression)
    before = open_run(path)
    found = recovered(path)
    after = open_run(found.path)
    assert list(after.messages()) == list(before.messages())
    assert after.topics == before.topics
    assert after.attachments == {"notes": b"x"}
    assert (found.is_complete, found.steps) == (True, 0)
    begin, end = places_of(path, Opcode.CHUNK)[2]
    spoil(path, (begin + end) // 2)
    damaged = recovered(path)
    assert damaged.chunks_lost == 1
    assert damaged.messages + sum(damaged.messages_lost.values()) == 100
    assert len(rosbags_reads(damaged.path)) == damaged.messages


def test_messages_whose_only_crc_does_not_match_are_not_kept(tmp_path):
    path = tmp_path / "bag.mcap"
    recorded_by_others(path, is_chunked=False)
    assert recovered(path).messages == 100
    spoil(path, places_of(path, Opcode.MESSAGE)[50][1] - 1)
    before = path.read_bytes()
    with pytest.raises(Exception, match="no message in it is sound"):
        recovered(path)
    assert path.read_bytes() == before


def test_a_recording_inside_of_an_attachment_is_not_taken_for_a_part_of_the_file(killed, tmp_path):
    """The attachment's length is damaged, and it holds chunks."""
    inner = tmp_path / "inner.mcap"
    recorded_by_others(inner)
    path = mcap_of(killed)
    data = path.read_bytes()
    topics = sorted(open_run(killed).topics)
    at = places_of(path, Opcode.CHUNK)[1][0]
    for flipped in (1, 4):
        record = bytearray(attachment("inner", inner.read_bytes()))
        record[flipped] ^= 2
        path.write_bytes(data[:at] + bytes(record) + data[at:])
        found = recovered(killed)
        assert set(open_run(found.path).counts.values()) == {found.steps}
        assert sorted(open_run(found.path).topics) == topics


def test_an_index_that_points_beyond_the_file_does_not_keep_the_search_going(run):
    """Behind the damaged record the next one is searched for up to the place that the summary tells."""
    path = mcap_of(run)
    contents = contents_of(path.read_bytes())
    contents.data.append(
        contents.data.pop(next(i for i, part in enumerate(contents.data) if isinstance(part, Metadata)))
    )
    contents.indexes[AttachmentIndex] = {"offset": 2**63}
    path.write_bytes(bytes_of(contents))
    begin, _ = places_of(path, Opcode.METADATA)[-1]
    path.write_bytes(path.read_bytes()[:begin] + b"\x0c" + b"\xff" * 8 + path.read_bytes()[begin + 9 :])
    with bounded():
        found = recover(run, None)
    assert found.messages == len(list(open_run(found.path).messages()))
    assert found.messages_lost == {}
