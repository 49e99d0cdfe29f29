"""`open_run` reads what was recorded: matches recorded by the real recorder, foreign orders and versions, damaged files."""

from __future__ import annotations

import csv
import math
import shutil
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from damaged_recordings import chunk_with, mcap_of, places_of, records_of, spoil, zstd_bomb
from fbql_common.core.cdr import Codec
from fbql_common.core.errors import BadInput
from fbql_common.core.types import Decision
from fbql_recording.core.decoding import MessageCodec
from fbql_recording.core.ros2msg import fields_of
from fbql_recording.mcap.format import MAX_RECORD_BYTES
from fbql_recording.mcap.reader import Corrupt
from fbql_recording.run import Run, open_run
from mcap.opcode import Opcode
from mcap.records import AttachmentIndex, MetadataIndex
from mcap.writer import CompressionType, Writer
from mcap_contents import bytes_of, contents_of
from recorded_match import record_match
from rosbags.highlevel import AnyReader

BEHAVIORS = ("ball_seeking", "wall_avoiding", "approaching")
LEARNING = {"controller": "fbql_literal", "guided": 1, "tie_rule": "first"}


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three episodes, one of them guided, of 300 steps: more than one chunk. Not to be changed."""
    return record_match(tmp_path_factory.mktemp("recorded") / "run", max_steps=300, **LEARNING)


@pytest.fixture(scope="module")
def short(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """The file of two episodes of six steps."""
    return mcap_of(record_match(tmp_path_factory.mktemp("short") / "run", max_steps=6)).read_bytes()


def rows_of(run: Path) -> list[dict[str, str]]:
    with (run / "episodes.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def steps_in(run: Path) -> int:
    """How many steps were decided: the last world state of an episode counts too."""
    return sum(int(row["steps"]) + 1 for row in rows_of(run))


def read_all(run: Run) -> int:
    return sum(1 for _ in run.steps())


# What is read


def test_every_message_is_read_as_another_reader_reads_it(recorded):
    run = open_run(recorded)
    with AnyReader([recorded]) as reader:
        theirs = [(c.topic, time_ns, bytes(data)) for c, time_ns, data in reader.messages()]
    ours = [(message.topic, message.log_time_ns, message.data) for message in run.messages()]
    assert sorted(ours) == sorted(theirs)
    assert len(ours) == sum(run.counts.values()) == 6 * steps_in(recorded)


def test_every_step_has_the_fields_that_another_reader_decodes(recorded):
    run = open_run(recorded)
    steps = {(step.episode, step.step): step for step in run.steps()}
    checked = 0
    with AnyReader([recorded]) as reader:
        for connection, _, data in reader.messages():
            theirs = reader.deserialize(data, connection.msgtype)
            step = steps[theirs.episode, theirs.step]
            parts = {"/world": step.world, "/wheel_command": step.command, "/fusion/decision": step.decision}
            parts |= {f"/behaviors/{name}": output for name, output in zip(BEHAVIORS, step.outputs, strict=True)}
            ours: Any = parts[connection.topic]
            for field in ours._fields[1:]:
                value = getattr(theirs, field)
                same = (
                    list(value) == list(getattr(ours, field))
                    if hasattr(value, "__len__")
                    else value == getattr(ours, field)
                )
                assert same, (connection.topic, field)
                checked += 1
    assert checked > steps_in(recorded) * 60


def test_episodes_are_those_of_the_run(recorded):
    rows = rows_of(recorded)
    episodes = open_run(recorded).episodes()
    assert [
        {
            "index": str(e.index), "phase": e.phase, "seed": str(e.seed), "outcome": e.outcome, "steps": str(e.steps),
            "collisions_begun": str(e.collisions_begun), "collision_steps": str(e.collision_steps), "return": str(e.return_),
        }
        for e in episodes
    ] == rows  # fmt: skip
    lengths = [int(row["steps"]) + 1 for row in rows]
    assert [(e.first_step, e.recorded_steps) for e in episodes] == list(
        zip([sum(lengths[:index]) for index in range(3)], lengths, strict=True)
    )


def test_columns_hold_every_step_in_order(recorded):
    run = open_run(recorded)
    columns = run.arrays()
    steps = list(run.steps())
    assert columns["stamp_ns"].tolist() == [step.stamp_ns for step in steps]
    assert columns["robot_x_m"].tolist() == [step.world.robot_x_m for step in steps]
    assert columns["truncated"].tolist() == [step.world.truncated for step in steps]
    assert columns["weights"].tolist() == [list(step.decision.weights) for step in steps]
    assert columns["q"].tolist() == [list(step.decision.q) for step in steps]
    assert columns["leaf_id"].tolist() == columns["joint_state"].tolist()
    assert columns["reference_left_rad_s"][:, 2].tolist() == [step.outputs[2].left_rad_s for step in steps]
    assert columns["observation.ball_seeking"].tolist() == [list(step.outputs[0].observation) for step in steps]
    assert columns["command_right_rad_s"].tolist() == [step.command.right_rad_s for step in steps]
    assert {len(column) for column in columns.values()} == {steps_in(recorded)}


def test_a_file_alone_tells_what_its_directory_tells(recorded, tmp_path):
    alone = shutil.copyfile(mcap_of(recorded), tmp_path / "alone.mcap")
    run, whole = open_run(alone), open_run(recorded)
    assert run.directory is None
    assert (run.behaviors, run.counts, run.parameters) == (whole.behaviors, whole.counts, whole.parameters)
    assert run.episodes() == whole.episodes()
    assert run.parameters["fusion"]["seed"] == 3
    assert run.about == whole.about
    assert (run.about["controller"], run.about["seed"]) == ("fbql_literal", "3")
    assert {"config.yaml", "episodes.csv", "policy.npz", *(f"trees/{name}.json" for name in BEHAVIORS)} == set(
        run.attachments
    )


def test_an_answer_that_was_not_heard_is_none_and_not_a_leaf(tmp_path):
    def hear(world, outputs):
        return [None if world.step in (5, 6) and i == 1 else output for i, output in enumerate(outputs)]

    run = open_run(record_match(tmp_path / "run", hear=hear, max_steps=20, episodes=1))
    steps = list(run.steps())
    assert [step.step for step in steps if step.outputs[1] is None] == [5, 6]
    assert [step.step for step in steps] == list(range(21))
    columns = run.arrays()
    assert columns["leaf_id"][5, 1] == -1
    assert math.isnan(columns["reference_left_rad_s"][5, 1])
    assert not np.isnan(columns["reference_left_rad_s"][5, 0])
    assert run.episodes()[0].degraded


@pytest.mark.parametrize("first", [0, 12])
def test_an_episode_that_began_again_is_there_twice(tmp_path, first):
    """Also where the first world state that is heard is a later one than the last of before."""
    run = open_run(record_match(tmp_path / "run", restart_at={0: (8, first)}, max_steps=30))
    assert [(e.index, e.recorded_steps, e.outcome) for e in run.episodes()] == [
        (0, 8, None),
        (0, 31 - first, "timeout"),
        (1, 31, "timeout"),
    ]
    assert [step.begins_again for step in run.steps()].index(True) == 8


# Recordings by others


def recorded_by_others(
    source: Path, path: Path, reorder: bool = True, leave_out: tuple[str, ...] = (), schema: Any = None
) -> Path:
    """A recording as `ros2 bag record` makes it: times of arrival, messages of steps mixed, nothing of ours beside."""
    run = open_run(source)
    messages = list(run.messages())
    if reorder:  # each topic is late by an amount of its own
        late = {topic: 40 + 7 * index for index, topic in enumerate(reversed(run.topics))}
        order = sorted(range(len(messages)), key=lambda index: index + late[messages[index].topic])
        messages = [messages[index] for index in order]
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=65536, compression=CompressionType.LZ4)
        writer.start("ros2", "another")
        channels = {}
        for name, topic in run.topics.items():
            text = topic.schema if schema is None else schema(topic)
            schema_id = writer.register_schema(topic.type_name, "ros2msg", text.encode())
            channels[name] = writer.register_channel(name, "cdr", schema_id)
        for index, message in enumerate(messages):
            if message.topic not in leave_out:
                writer.add_message(channels[message.topic], 10**18 + index, message.data, 10**18 + index)
        writer.finish()
    return path


def test_steps_come_out_the_same_whatever_the_order_of_the_messages(recorded, tmp_path):
    foreign = open_run(recorded_by_others(recorded, tmp_path / "foreign.mcap"))
    assert list(foreign.steps()) == list(open_run(recorded).steps())
    assert foreign.behaviors == BEHAVIORS
    assert foreign.parameters == {}
    assert foreign.summary is None


def test_a_topic_that_was_not_recorded_is_not_available_and_never_zero(recorded, tmp_path):
    path = recorded_by_others(recorded, tmp_path / "x.mcap", leave_out=("/fusion/decision", "/behaviors/approaching"))
    run = open_run(path)
    episode = run.episodes()[0]
    assert (episode.phase, episode.return_, episode.degraded) == (None, None, None)
    assert episode.collisions_begun is not None
    step = next(iter(run.steps()))
    assert step.decision is None
    assert None in step.outputs


def test_no_messages_is_no_time_and_no_episode(recorded, tmp_path):
    path = recorded_by_others(recorded, tmp_path / "x.mcap", leave_out=tuple(open_run(recorded).topics))
    run = open_run(path)
    assert (run.start_ns, run.end_ns, run.episodes()) == (None, None, [])
    assert set(run.counts.values()) == {0}
    assert len(run.arrays()["stamp_ns"]) == 0


def test_a_message_of_another_version_is_decoded_by_its_own_schema(recorded, tmp_path):
    """`WheelCommand` with its wheels the other way round: the bytes are the same, the fields are not."""

    def swapped(topic):
        text = topic.schema
        if topic.name == "/wheel_command":
            text = text.replace("left_rad_s", "X").replace("right_rad_s", "left_rad_s").replace("X", "right_rad_s")
        return text

    run = open_run(recorded_by_others(recorded, tmp_path / "x.mcap", schema=swapped))
    for theirs, ours in zip(run.steps(), open_run(recorded).steps(), strict=True):
        assert theirs.command[3:] == (ours.command.right_rad_s, ours.command.left_rad_s)


def test_a_decision_from_before_the_learned_weights_has_none_of_them(recorded):
    run = open_run(recorded)
    schema = run.topics["/fusion/decision"].schema
    older = "\n".join(line for line in schema.splitlines() if "learned_weights" not in line)
    name = "fbql_msgs/msg/FusionDecision"
    bytes_of = Codec([field.kind for field in fields_of(name, older)])
    codec = MessageCodec[Decision](name, older)
    assert codec.missing == {"learned_weights"}
    decisions = [step.decision for step in run.steps()]
    assert len(decisions) > 3
    for decision in decisions:
        header = (decision.stamp_ns // 10**9, decision.stamp_ns % 10**9, "field")
        data = bytes_of.encode((*header, *decision[1:-1]))
        assert codec.decode(data) == decision._replace(learned_weights=())
        with pytest.raises(TypeError, match="other fields"):
            codec.encode(decision)


@pytest.mark.parametrize(
    ("line", "instead", "says"),
    [
        ("float64 robot_x_m", "float64 robot_z_m", "WorldState lacks the field robot_x_m"),
        ("float64 robot_x_m", "string robot_x_m", "has robot_x_m as string"),
        ("float64 robot_x_m", "pkg/Odd robot_x_m", "no definition of pkg/Odd"),
        ("float64 robot_x_m", "wstring robot_x_m", "which is not supported"),
    ],
)
def test_a_schema_that_lacks_what_is_needed_is_refused(recorded, tmp_path, line, instead, says):
    path = recorded_by_others(recorded, tmp_path / "x.mcap", schema=lambda topic: topic.schema.replace(line, instead))
    with pytest.raises(BadInput, match=says):
        open_run(path)


# Damaged files


def test_a_flipped_bit_names_chunk_and_time(run):
    begin, end = places_of(mcap_of(run), Opcode.CHUNK)[1]
    spoil(mcap_of(run), (begin + end) // 2)
    opened = open_run(run)
    with pytest.raises(Corrupt, match=r"run_0\.mcap: chunk 2 \(\d+\.\d+ s to \d+\.\d+ s, at byte \d+\) is damaged"):
        read_all(opened)


def test_a_damaged_chunk_is_left_out_and_counted_where_the_rest_is_wanted(run):
    whole = read_all(open_run(run))
    begin, end = places_of(mcap_of(run), Opcode.CHUNK)[1]
    spoil(mcap_of(run), (begin + end) // 2)
    opened = open_run(run, skip_corrupt=True)
    assert 0 < read_all(opened) < whole
    assert not opened.is_complete
    assert len(opened.warnings) == 1
    assert "left out: chunk 2" in opened.warnings[0]


@pytest.mark.parametrize(
    "opcode",
    [Opcode.SCHEMA, Opcode.CHANNEL, Opcode.CHUNK, Opcode.MESSAGE_INDEX, Opcode.ATTACHMENT, Opcode.METADATA, Opcode.DATA_END,
     Opcode.STATISTICS, Opcode.CHUNK_INDEX],
)  # fmt: skip
@pytest.mark.parametrize("where", [0.0, 0.2, 0.5, 1.0])
def test_no_bit_can_flip_unnoticed(short, tmp_path, opcode, where):
    """Anywhere in a record: its kind, its length, its content, its last byte."""
    path = tmp_path / "run.mcap"
    path.write_bytes(short)
    begin, end = places_of(path, opcode)[0]
    spoil(path, begin + int(where * (end - begin - 1)))
    with pytest.raises(BadInput, match="run"):
        read_all(open_run(path))


def test_a_file_that_was_cut_off_is_used_up_to_its_last_whole_chunk(run):
    path = mcap_of(run)
    data = path.read_bytes()
    begin, end = places_of(path, Opcode.CHUNK)[1]
    path.write_bytes(data[: end - 1])
    opened = open_run(run)
    assert not opened.is_complete
    messages = sum(opened.counts.values())
    assert 0 < messages < 6 * steps_in(run)
    assert opened.warnings == [
        f"{path}: cut off at byte {begin} of {end - 1}; the complete part, {messages} messages, is used"
    ]
    steps = list(opened.steps())
    assert len(steps) == math.ceil(messages / 6)


@pytest.mark.parametrize(("opcode", "what"), [(Opcode.SCHEMA, "schema"), (Opcode.CHANNEL, "channel")])
def test_what_is_described_twice_and_differently_is_damage(tmp_path, opcode, what):
    """A killed recorder leaves no CRC over these: the second gets the number of the first."""
    run = record_match(tmp_path / "run", max_steps=6, episodes=1, close=False)
    path = next(run.glob("*.active"))
    begin, _ = places_of(path, opcode)[1]
    spoil(path, begin + 9, b"\x01\x00")
    with pytest.raises(Corrupt, match=f"{what} 1 is described twice, and differently"):
        open_run(run)


def test_what_a_killed_recorder_leaves_is_read(tmp_path):
    run = open_run(record_match(tmp_path / "run", close=False))
    assert read_all(run) == 2 * 61
    assert not run.is_complete
    assert "not finished" in run.warnings[0]
    assert run.parameters["fusion"]["seed"] == 3


def test_every_cut_is_survived(tmp_path):
    """Cut at every 97th byte, and at each record's boundary: what is read is the beginning of the whole."""
    source = record_match(tmp_path / "run", max_steps=6, episodes=1)
    data = mcap_of(source).read_bytes()
    whole = [(message.topic, message.data) for message in open_run(source).messages()]
    cut = tmp_path / "cut.mcap"
    boundaries = {at for record in records_of(data) for at in (record.begin, record.end)}
    seen: set[int] = set()
    for size in sorted({*range(8, len(data), 97), *boundaries}):
        cut.write_bytes(data[:size])
        run = open_run(cut)
        read = [(message.topic, message.data) for message in run.messages()]
        assert read == whole[: len(read)]
        assert not run.is_complete
        seen.add(len(read))
    assert seen == {0, len(whole)}


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (b"", "empty"),
        (b"\x89MC", "cut off after 3 bytes"),
        (b"SQLite format 3\0" * 10, "not an MCAP file"),
    ],
)
def test_what_is_no_recording_is_one_clear_line(tmp_path, content, says):
    path = tmp_path / "x.mcap"
    path.write_bytes(content)
    with pytest.raises(BadInput, match=says):
        open_run(path)


def test_another_profile_is_refused(run):
    data = mcap_of(run).read_bytes()
    spoil(mcap_of(run), data.index(b"ros2"), b"ros1")
    with pytest.raises(BadInput, match="profile is 'ros1'"):
        read_all(open_run(run))


@pytest.mark.parametrize(
    ("record", "says"),
    [
        (chunk_with(b"brotli", 10, b"x" * 10), "compressed by 'brotli'"),
        (chunk_with(b"zstd", 2**50, b"x" * 10), "unpacks to 1125899906842624 bytes; at most 64 MiB"),
        (chunk_with(b"", 10, b"x" * 11), "unpacks to 11 bytes instead of 10"),
        (chunk_with(b"lz4", 10, b"x" * 11), "can't be unpacked"),
    ],
    ids=["compression", "promise", "length", "packed"],
)
def test_a_chunk_that_is_no_such_is_a_clear_line(run, record, says):
    path = mcap_of(run)
    data = path.read_bytes()
    begin, _ = places_of(path, Opcode.CHUNK)[0]
    path.write_bytes(data[:begin] + record)
    with pytest.raises(BadInput, match=says):
        open_run(path)


def test_a_record_that_is_too_large_is_refused_before_it_is_read(run):
    path = mcap_of(run)
    _, end = places_of(path, Opcode.HEADER)[0]
    with path.open("r+b") as file:
        file.seek(end)
        file.write(struct.pack("<BQ", Opcode.ATTACHMENT, MAX_RECORD_BYTES + 1))
        file.truncate(end + 9 + MAX_RECORD_BYTES + 1)  # sparse: no disk is used
    with pytest.raises(BadInput, match=r"a record of \d+ bytes at byte \d+; at most 64 MiB"):
        open_run(path)


def test_a_small_chunk_that_unpacks_to_much_is_never_unpacked_whole(run):
    """A zstd bomb that lies about its size: a frame without a size, 100 MiB of zeros."""
    path = mcap_of(run)
    data = path.read_bytes()
    path.write_bytes(data[: places_of(path, Opcode.CHUNK)[0][0]] + chunk_with(b"zstd", 1000, zstd_bomb(100 << 20)))
    with pytest.raises(Corrupt, match="unpacks to 1001 bytes instead of 1000"):
        open_run(path)


@pytest.mark.parametrize("kind", [AttachmentIndex, MetadataIndex])
@pytest.mark.parametrize("offset", [2**64 - 1, 2**63, 2**40])
def test_an_index_that_points_beyond_the_file_is_damage(short, tmp_path, kind, offset):
    contents = contents_of(short)
    contents.indexes[kind] = {"offset": offset}
    path = tmp_path / "x.mcap"
    path.write_bytes(bytes_of(contents))
    with pytest.raises(Corrupt, match=f"at byte {offset}: a record that the summary points at is not there"):
        open_run(path)
    run = open_run(path, skip_corrupt=True)
    assert read_all(run) == 14
    assert not run.is_complete


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("episodes.csv", b"index,seed\n0," + b"1" * 200_000),
        ("episodes.csv", b"index,seed\n0," + b"1" * 5_000),
        ("summary.json", b"[" * 100_000),
        ("summary.json", b'{"episodes": ' + b"1" * 5_000 + b"}"),
        ("summary.json", b'{"episodes": NaN}'),
    ],
    ids=["long field", "long number", "nested", "long number in JSON", "not a number"],
)
def test_files_beside_the_recording_that_cannot_be_read_are_one_line(short, tmp_path, name, text):
    """The recording's own copies come first: here it has none."""
    contents = contents_of(short)
    contents.data = [part for part in contents.data if getattr(part, "name", "") != name]
    (tmp_path / "x.mcap").write_bytes(bytes_of(contents))
    (tmp_path / name).write_bytes(text)
    run = open_run(tmp_path)
    with pytest.raises(
        BadInput, match=rf"/{name}: [^\n]*$" if name == "summary.json" else f": {name} has no such rows"
    ):
        assert run.episodes() and run.summary


# Directories


def edit(run: Path, **changes: object) -> None:
    document = yaml.safe_load((run / "metadata.yaml").read_text())
    document["rosbag2_bagfile_information"].update(changes)
    (run / "metadata.yaml").write_text(yaml.safe_dump(document))


@pytest.mark.parametrize("name", ["../outside.mcap", "/etc/hostname", "log/../../outside.mcap", "a\0b"])
def test_metadata_never_leads_out_of_the_directory(run, name):
    shutil.copyfile(mcap_of(run), run.parent / "outside.mcap")
    edit(run, relative_file_paths=[name])
    with pytest.raises(BadInput, match="leads out of the directory"):
        open_run(run)


@pytest.mark.parametrize("name", ["run_0.mcap", "metadata.yaml", "summary.json"])
def test_a_link_never_leads_out_of_the_directory(run, name):
    outside = run.parent / "outside"
    (run / name).rename(outside)
    (run / name).symlink_to(outside)
    with pytest.raises(BadInput, match="leads out of the directory"):
        _ = open_run(run).summary


def test_a_link_inside_of_the_directory_is_followed(run):
    mcap_of(run).rename(run / "log" / "kept")
    (run / "run_0.mcap").symlink_to(Path("log") / "kept")
    assert read_all(open_run(run)) == steps_in(run)


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"storage_identifier": "sqlite3"}, "only mcap is read"),
        ({"compression_format": "zstd"}, "compressed as a whole"),
        ({"relative_file_paths": []}, "names no recording"),
        ({"relative_file_paths": ["gone.mcap"]}, "gone.mcap, which is not there"),
    ],
)
def test_a_bag_that_cannot_be_read_is_one_clear_line(run, changes, says):
    edit(run, **changes)
    with pytest.raises(BadInput, match=says):
        open_run(run)


@pytest.mark.parametrize("text", ["", "[1, 2]", "{", "a: b", "\x00"])
def test_metadata_that_is_none_is_one_clear_line(run, text):
    (run / "metadata.yaml").write_text(text)
    with pytest.raises(BadInput, match=r"metadata\.yaml"):
        open_run(run)


def test_a_directory_without_a_recording_says_so(tmp_path):
    with pytest.raises(BadInput, match="no recording there"):
        open_run(tmp_path)
    with pytest.raises(BadInput, match="no such run"):
        open_run(tmp_path / "gone")


def test_files_of_a_split_bag_are_read_one_after_the_other(run):
    shutil.copyfile(mcap_of(run), run / "run_1.mcap")
    edit(run, relative_file_paths=["run_0.mcap", "run_1.mcap"])
    opened = open_run(run)
    assert sum(opened.counts.values()) == 2 * 6 * steps_in(run)
    assert sum(1 for _ in opened.messages()) == 2 * 6 * steps_in(run)
