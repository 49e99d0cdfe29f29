"""The recording, read back by independent readers: the mcap package with CRCs checked, and rosbags."""

import io
import json
import shutil
import struct
import subprocess
import sys
import zlib
from contextlib import suppress
from pathlib import Path

import pytest
import yaml
from fbql_common.core.errors import BadInput
from fbql_recording.bag_metadata import INFINITE_NS, Qos
from fbql_recording.message_definitions import schema_text, type_hash
from fbql_recording.recorder import CHUNK_BYTES, Attachment, Channel, Recorder
from file_limit import largest_file
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.exceptions import EndOfFile
from mcap.opcode import Opcode
from mcap.reader import NonSeekingReader, make_reader
from mcap.records import Attachment as AttachmentRecord
from mcap.records import Channel as ChannelRecord
from mcap.records import Chunk, McapRecord, Metadata, Schema
from mcap.records import Message as MessageRecord
from mcap.stream_reader import CRCValidationError, StreamReader, breakup_chunk
from mcap.writer import MCAP0_MAGIC
from patience import PATIENCE_S
from places import ROOT
from rosbags.rosbag2 import Reader
from zstandard import ZstdError, decompress

CHANNELS = [
    Channel("/a", "pkg/msg/A", "int64 x\n", "RIHS01_a", Qos()),
    Channel("/b", "pkg/msg/B", "float64 y\n", "RIHS01_b", Qos(reliability="best_effort", depth=1, deadline_ns=10**8)),
    Channel("/c", "pkg/msg/A", "int64 x\n", "RIHS01_a", Qos()),
]


class Reports(list[str]):
    """What was reported."""

    __call__ = list.append


def recorder(directory: Path, reports: Reports | None = None, **changes: object) -> Recorder:
    directory.mkdir(exist_ok=True)
    arguments: dict[str, object] = {"custom_data": {}, "attachments": ()} | changes
    return Recorder(directory, CHANNELS, report=Reports() if reports is None else reports, **arguments)


def cdr(number: int, size: int = 8) -> bytes:
    return b"\x00\x01\x00\x00" + number.to_bytes(size, "little")


def in_file_order(path: Path) -> list[tuple[str, int, bytes]]:
    """The messages of a file, whether it has an end or not."""
    found: list[tuple[str, int, bytes]] = []
    with path.open("rb") as file, suppress(EndOfFile):
        for _, channel, message in NonSeekingReader(file, validate_crcs=True).iter_messages(log_time_order=False):
            found.append((channel.topic, message.log_time, message.data))
    return found


def records_of[Record: McapRecord](path: Path, kind: type[Record]) -> list[Record]:
    """The records of one kind, outside of chunks, of a file that has no end."""
    records: list[McapRecord] = []
    with path.open("rb") as file, suppress(EndOfFile):
        records.extend(StreamReader(file, emit_chunks=True, validate_crcs=True).records)
    return [record for record in records if isinstance(record, kind)]


def ends_with_a_whole_record(path: Path) -> bool:
    """Walks a file from record to record by their lengths."""
    data = path.read_bytes()
    offset = len(MCAP0_MAGIC)
    while offset < len(data):
        (length,) = struct.unpack_from("<Q", data, offset + 1)
        offset += 9 + length
    return offset == len(data)


# Message definitions

PACKAGES = {
    "pkg/msg/A.msg": "# about A: other/Wrong\nint64 x  # pkg/Wrong\nB[] many\nother/C one\nstring<=5 text 'a # b'\n",
    "pkg/msg/B.msg": "int8 K=3\nfloat64[3] y\nother/C again\n",
    "other/msg/C.msg": "pkg/B[<=2] back\nuint8 z\n",
}


@pytest.fixture
def share(tmp_path: Path) -> Path:
    for name, text in PACKAGES.items():
        path = tmp_path / "share" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    hashes = {"type_hashes": [{"type_name": "pkg/msg/A", "hash_string": "RIHS01_aa"}]}
    (tmp_path / "share/pkg/msg/A.json").write_text(json.dumps(hashes))
    return tmp_path / "share"


def test_schema_text_is_the_message_and_each_contained_one_once(share):
    line = "=" * 80
    assert schema_text("pkg/msg/A", share.joinpath) == (
        f"{PACKAGES['pkg/msg/A.msg']}\n"
        f"{line}\nMSG: pkg/B\n{PACKAGES['pkg/msg/B.msg']}\n"
        f"{line}\nMSG: other/C\n{PACKAGES['other/msg/C.msg']}"
    )


def test_type_hash_is_that_of_the_described_type(share):
    assert type_hash("pkg/msg/A", share.joinpath) == "RIHS01_aa"


@pytest.mark.parametrize("spoil", ["{", "{}", '{"type_hashes": []}', '{"type_hashes": 3}', "[]"])
def test_a_missing_definition_or_description_is_one_clear_line(share, spoil):
    (share / "pkg/msg/A.json").write_text(spoil)
    with pytest.raises(BadInput, match=r"A\.json: no type hash of pkg/msg/A"):
        type_hash("pkg/msg/A", share.joinpath)
    with pytest.raises(BadInput, match=r"D\.json: no type hash"):
        type_hash("pkg/msg/D", share.joinpath)
    (share / "other/msg/C.msg").unlink()
    with pytest.raises(BadInput, match=r"C\.msg: no definition of other/msg/C"):
        schema_text("pkg/msg/A", share.joinpath)


# A whole recording


@pytest.fixture
def finished(tmp_path: Path) -> Path:
    """A recording of 3 x 400 messages of 1 kB, with everything that can be in one."""
    recording = recorder(
        tmp_path / "run",
        custom_data={"seed": "7", "note": "ä: {b}\nsecond line"},
        attachments=[Attachment("trees/a.json", "application/json", b"{}")],
    )
    for step in range(400):
        for channel in range(3):
            recording.write(channel, cdr(step * 3 + channel, 1000), 1000 + step)
        if step == 100:
            recording.flush()
    recording.close([Attachment("policy.npz", "application/octet-stream", b"\x00" * 100)])
    assert recording.messages == 1200
    assert not recording.failed
    return tmp_path / "run"


def test_every_message_is_read_back_with_crcs_checked(finished):
    messages = in_file_order(finished / "run_0.mcap")
    assert messages == [
        (f"/{'abc'[channel]}", 1000 + step, cdr(step * 3 + channel, 1000))
        for step in range(400)
        for channel in range(3)
    ]
    with (finished / "run_0.mcap").open("rb") as file:
        by_index = list(make_reader(file, validate_crcs=True).iter_messages())
    assert [(channel.topic, message.log_time, message.data) for _, channel, message in by_index] == messages
    assert all(message.publish_time == message.log_time for _, _, message in by_index)
    assert [message.sequence for _, channel, message in by_index if channel.topic == "/b"] == list(range(1, 401))


def test_file_says_what_ros_tools_need(finished):
    with (finished / "run_0.mcap").open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        assert reader.get_header().profile == "ros2"
        summary = reader.get_summary()
        assert summary is not None
        schemas = {schema.name: (schema.encoding, schema.data) for schema in summary.schemas.values()}
        assert schemas == {"pkg/msg/A": ("ros2msg", b"int64 x\n"), "pkg/msg/B": ("ros2msg", b"float64 y\n")}
        channels = {channel.topic: channel for channel in summary.channels.values()}
        assert {channel.message_encoding for channel in channels.values()} == {"cdr"}
        assert channels["/b"].metadata["topic_type_hash"] == "RIHS01_b"
        assert yaml.safe_load(channels["/b"].metadata["offered_qos_profiles"]) == [
            {
                "history": "keep_last",
                "depth": 1,
                "reliability": "best_effort",
                "durability": "volatile",
                "deadline": {"sec": 0, "nsec": 100_000_000},
                "lifespan": {"sec": INFINITE_NS // 10**9, "nsec": INFINITE_NS % 10**9},
                "liveliness": "automatic",
                "liveliness_lease_duration": {"sec": 9223372036, "nsec": 854775807},
                "avoid_ros_namespace_conventions": False,
            }
        ]
        assert summary.statistics is not None
        assert summary.statistics.message_count == 1200
        assert (summary.statistics.message_start_time, summary.statistics.message_end_time) == (1000, 1399)
        metadata = {record.name: record.metadata for record in reader.iter_metadata()}
        assert metadata["fbql"] == {"seed": "7", "note": "ä: {b}\nsecond line"}
        assert [(a.name, a.media_type, a.data) for a in reader.iter_attachments()] == [
            ("trees/a.json", "application/json", b"{}"),
            ("policy.npz", "application/octet-stream", b"\x00" * 100),
        ]
    information = yaml.safe_load((finished / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    assert yaml.safe_load(metadata["rosbag2"]["serialized_metadata"]) == information


def test_directory_is_a_bag_of_metadata_version_9(finished):
    information = yaml.safe_load((finished / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    assert information["version"] == 9
    assert information["storage_identifier"] == "mcap"
    assert information["relative_file_paths"] == ["run_0.mcap"]
    assert information["starting_time"] == {"nanoseconds_since_epoch": 1000}
    assert information["duration"] == {"nanoseconds": 399}
    assert information["message_count"] == 1200
    assert [topic["message_count"] for topic in information["topics_with_message_count"]] == [400] * 3
    assert (information["compression_format"], information["compression_mode"]) == ("", "")
    with Reader(finished) as bag:
        assert bag.message_count == 1200
        assert [(c.topic, c.msgtype, c.digest, c.msgcount) for c in bag.connections] == [
            ("/a", "pkg/msg/A", "RIHS01_a", 400),
            ("/b", "pkg/msg/B", "RIHS01_b", 400),
            ("/c", "pkg/msg/A", "RIHS01_a", 400),
        ]
        assert bag.connections[1].msgdef.data == "float64 y\n"
        assert bag.connections[1].ext.offered_qos_profiles[0].reliability.name == "BEST_EFFORT"
        assert bag.storage.metadata.custom == {"seed": "7", "note": "ä: {b}\nsecond line"}
        assert sum(1 for _ in bag.messages()) == 1200


def test_chunks_are_zstd_of_the_set_size(finished):
    with (finished / "run_0.mcap").open("rb") as file:
        records = list(StreamReader(file, emit_chunks=True, validate_crcs=True).records)
    chunks = [record for record in records if isinstance(record, Chunk)]
    assert {chunk.compression for chunk in chunks} == {"zstd"}
    assert all(chunk.uncompressed_crc for chunk in chunks)
    # 101 steps until the flush, then full chunks, then the rest.
    assert [chunk.uncompressed_size >= CHUNK_BYTES for chunk in chunks] == [True, False, True, True, True, False]
    assert all(chunk.uncompressed_size < CHUNK_BYTES + 1035 for chunk in chunks[1:])


def test_schemas_and_channels_stand_before_the_first_chunk_and_in_it_where_its_crc_covers_them(finished):
    with (finished / "run_0.mcap").open("rb") as file:
        records = list(StreamReader(file, emit_chunks=True, validate_crcs=True).records)
    chunks = [(number, record) for number, record in enumerate(records) if isinstance(record, Chunk)]
    before = [record for record in records[: chunks[0][0]] if isinstance(record, Schema | ChannelRecord)]
    assert [type(record) for record in before] == [Schema] * 2 + [ChannelRecord] * 3
    inside = [
        [record for record in breakup_chunk(chunk, validate_crc=True) if not isinstance(record, MessageRecord)]
        for _, chunk in chunks
    ]
    assert inside == [before, *[[]] * (len(chunks) - 1)]


def test_every_message_index_points_to_its_messages(finished):
    data = (finished / "run_0.mcap").read_bytes()
    summary = make_reader(io.BytesIO(data)).get_summary()
    assert summary is not None
    found = 0
    for chunk in summary.chunk_indexes:
        start = chunk.chunk_start_offset + chunk.chunk_length - chunk.compressed_size
        messages = decompress(data[start : start + chunk.compressed_size], chunk.uncompressed_size)
        assert sorted(chunk.message_index_offsets) == [1, 2, 3]
        end = chunk.chunk_start_offset + chunk.chunk_length + chunk.message_index_length
        for channel, offset in chunk.message_index_offsets.items():
            opcode, length, number, size = struct.unpack_from("<BQHI", data, offset)
            assert (opcode, length, number) == (Opcode.MESSAGE_INDEX, size + 6, channel)
            assert offset + 9 + length <= end
            for time_ns, place in struct.iter_unpack("<QQ", data[offset + 15 : offset + 15 + size]):
                assert struct.unpack_from("<BQHIQ", messages, place)[0::2] == (Opcode.MESSAGE, channel, time_ns)
                found += 1
    assert found == 1200


def test_summary_and_footer_carry_their_crc(finished):
    data = (finished / "run_0.mcap").read_bytes()
    footer = len(data) - len(MCAP0_MAGIC) - 20
    summary_start, _, crc = struct.unpack_from("<QQI", data, footer)
    assert crc == zlib.crc32(data[summary_start : footer + 16])


def test_a_flipped_bit_is_found_wherever_messages_are(finished):
    path = finished / "run_0.mcap"
    data = path.read_bytes()
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    for index in summary.chunk_indexes:
        spoilt = bytearray(data)
        spoilt[index.chunk_start_offset + index.chunk_length // 2] ^= 4
        path.write_bytes(spoilt)
        with pytest.raises((CRCValidationError, ZstdError)):
            in_file_order(path)


@settings(deadline=None)
@given(
    st.lists(
        st.tuples(st.integers(0, 2), st.binary(max_size=60), st.integers(0, 2**63 - 1), st.booleans()), max_size=40
    )
)
def test_any_sequence_of_messages_comes_back_in_order(tmp_path_factory, sequence):
    directory = tmp_path_factory.mktemp("any")
    recording = recorder(directory)
    for channel, data, time_ns, flush in sequence:
        recording.write(channel, data, time_ns)
        if flush:
            recording.flush()
    recording.close()
    expected = [(f"/{'abc'[channel]}", time_ns, data) for channel, data, time_ns, _ in sequence]
    assert in_file_order(recording.path) == expected
    times = [time_ns for _, _, time_ns, _ in sequence]
    span = yaml.safe_load((directory / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    assert span["starting_time"]["nanoseconds_since_epoch"] == min(times, default=0)
    assert span["duration"]["nanoseconds"] == max(times, default=0) - min(times, default=0)


# From the first byte to the last


def test_file_is_active_until_it_is_finished_and_metadata_comes_last(tmp_path):
    recording = recorder(tmp_path / "run")
    recording.write(0, cdr(1), 5)
    assert recording.messages == 1
    recording.flush()
    assert recording.messages == 1
    assert [path.name for path in (tmp_path / "run").iterdir()] == ["run_0.mcap.active"]
    recording.close()
    assert sorted(path.name for path in (tmp_path / "run").iterdir()) == ["metadata.yaml", "run_0.mcap"]


def test_after_a_flush_everything_is_readable_without_an_end(tmp_path):
    recording = recorder(
        tmp_path / "run", custom_data={"seed": "1"}, attachments=[Attachment("config.yaml", "text/yaml", b"a: 1")]
    )
    for number in range(10):
        recording.write(number % 3, cdr(number), number)
    recording.flush()
    recording.write(0, cdr(10), 10)
    assert [time_ns for _, time_ns, _ in in_file_order(recording.active_path)] == list(range(10))
    assert [record.data for record in records_of(recording.active_path, AttachmentRecord)] == [b"a: 1"]
    assert [record.metadata for record in records_of(recording.active_path, Metadata)] == [{"seed": "1"}]
    recording.close()


def test_a_recording_without_messages_is_one_too(tmp_path):
    recording = recorder(tmp_path / "run")
    recording.close()
    assert in_file_order(recording.path) == []
    with Reader(tmp_path / "run") as bag:
        assert bag.message_count == 0


def test_closing_twice_and_writing_afterwards_does_nothing(tmp_path):
    recording = recorder(tmp_path / "run")
    recording.write(0, cdr(1), 1)
    recording.close()
    data = recording.path.read_bytes()
    recording.write(0, cdr(2), 2)
    recording.flush()
    recording.close()
    assert recording.path.read_bytes() == data
    assert recording.messages == 1


# Where it can't be


def test_a_recording_is_never_overwritten(finished):
    with pytest.raises(BadInput, match=r"run_0\.mcap exists"):
        recorder(finished)
    (finished / "run_0.mcap").unlink()
    with pytest.raises(BadInput, match=r"metadata\.yaml exists"):
        recorder(finished)
    (finished / "metadata.yaml").unlink()
    (finished / "run_0.mcap.active").write_bytes(b"of a crash")
    with pytest.raises(BadInput, match="File exists"):
        recorder(finished)
    assert (finished / "run_0.mcap.active").read_bytes() == b"of a crash"


def test_a_directory_that_is_none_is_refused_before_the_start(tmp_path):
    with pytest.raises(BadInput, match="No such file or directory"):
        Recorder(tmp_path / "missing", CHANNELS, {}, (), Reports())
    (tmp_path / "file").touch()
    with pytest.raises(BadInput, match="Not a directory"):
        Recorder(tmp_path / "file", CHANNELS, {}, (), Reports())


# A disk that is full


def test_a_failing_disk_stops_the_recording_once_and_leaves_whole_chunks(tmp_path):
    reports = Reports()
    with largest_file(20_000):
        recording = recorder(tmp_path / "run", reports)
        for number in range(1000):
            # Numbers that do not compress to nothing.
            recording.write(0, cdr(pow(3, number + 900, 1 << 800), 100), number)
            if number % 10 == 9:
                recording.flush()
        recording.close()
    assert recording.failed
    assert len(reports) == 1
    assert "File too large" in reports[0]
    left = in_file_order(recording.active_path)
    assert [time_ns for _, time_ns, _ in left] == list(range(recording.messages))
    assert 20 <= len(left) < 900
    assert ends_with_a_whole_record(recording.active_path)
    assert sorted(path.name for path in (tmp_path / "run").iterdir()) == ["run_0.mcap.active"]


def test_a_disk_that_fails_at_the_very_end_leaves_no_metadata(tmp_path):
    reports = Reports()
    recording = recorder(tmp_path / "run", reports)
    recording.write(0, cdr(1), 1)
    recording.flush()
    with largest_file(recording.active_path.stat().st_size):
        recording.close()
    assert recording.failed
    assert len(reports) == 1
    assert recording.messages == 1
    assert len(in_file_order(recording.active_path)) == 1
    assert ends_with_a_whole_record(recording.active_path)
    assert not (tmp_path / "run/metadata.yaml").exists()


def test_a_disk_that_is_full_from_the_start_is_refused(tmp_path):
    with largest_file(100), pytest.raises(BadInput, match="File too large"):
        recorder(tmp_path / "run")
    assert list((tmp_path / "run").iterdir()) == []


def test_a_full_file_system_stops_the_recording_and_nothing_else(tmp_path):
    """Fault 44 on a real full tmpfs of one megabyte, in a mount namespace of its own."""
    namespace = ["unshare", "--user", "--map-root-user", "--mount"]
    can = (
        shutil.which("unshare")
        and subprocess.run(
            [*namespace, "mount", "-t", "tmpfs", "tmpfs", str(tmp_path)], capture_output=True, check=False
        ).returncode
        == 0
    )
    if not can:
        pytest.skip("no mount namespaces here: a full file system can't be made")
    scenario = ROOT / "tests/helpers/full_disk.py"
    command = 'mount -t tmpfs -o size=1m tmpfs "$1" && shift && exec "$@"'
    done = subprocess.run(
        [*namespace, "sh", "-c", command, "sh", str(tmp_path), sys.executable, str(scenario), str(tmp_path)],
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert result["recorder_failed"]
    assert result["run_failed"]
    assert len(result["reports"]) == 2
    assert all("No space left on device" in report for report in result["reports"])
    assert 0 < result["messages"] == result["readable"] < result["written"]
    assert result["rows"] == result["whole_rows"] > 0
    assert result["summary_after_room"] == {"incomplete": True}


@pytest.mark.parametrize("log_time_ns", [-1, 1 << 64])
def test_a_time_that_mcap_has_not_is_refused_before_anything_is_lost(tmp_path: Path, log_time_ns: int) -> None:
    made = recorder(tmp_path)
    made.write(0, cdr(1), 5)
    with pytest.raises(ValueError, match="log_time_ns"):
        made.write(0, cdr(2), log_time_ns)
    made.close()
    assert not made.failed
    assert len(in_file_order(made.path)) == 1
