"""Damaged recordings, made from sound ones: cut off, flipped, foreign, lying about sizes, leading elsewhere.

`corpus` gives them all, always the same. Each is a function that makes one in an empty directory and gives its path. As a
program it makes them all, for a reader of one's own: `python tests/helpers/damaged_recordings.py DIR`, after
`source scripts/env.sh`. DIR/index.tsv names each, and what a user would name.
"""

from __future__ import annotations

import json
import os
import shutil
import struct
import sys
import zlib
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import NamedTuple

import zstandard
from mcap.opcode import Opcode
from mcap.writer import MCAP0_MAGIC, Writer
from recorded_match import record_match

GIB = 2**30
HEAD_BYTES = 9
"""opcode and length"""
IN_DATA = (
    Opcode.HEADER,
    Opcode.SCHEMA,
    Opcode.CHANNEL,
    Opcode.CHUNK,
    Opcode.MESSAGE_INDEX,
    Opcode.ATTACHMENT,
    Opcode.METADATA,
    Opcode.DATA_END,
)
"""Kinds of record whose first is in the data section, not in the summary."""


class Record(NamedTuple):
    """Where a record is in a file."""

    opcode: int
    begin: int
    end: int

    @property
    def name(self) -> str:
        return Opcode(self.opcode).name.lower()


class Case(NamedTuple):
    """One damaged recording."""

    name: str
    make: Callable[[Path], Path]
    """Makes it in an empty directory; gives what a user would name."""
    is_ours: bool = True
    """Whether its messages are those of the sound recording; else it is somebody else's, or none."""


class Sound(NamedTuple):
    """The recordings that are damaged: of one match, finished and as SIGKILL leaves it."""

    finished: Path
    """Run directory."""
    killed: Path
    """Run directory."""


def record_sound(place: Path) -> Sound:
    """Records two short episodes, one of which begins again: three chunks and a note between them."""
    options = {"max_steps": 6, "episodes": 2, "restart_at": {1: (3, 0)}, "controller": "fbql_literal", "guided": 1}
    return Sound(record_match(place / "finished", **options), record_match(place / "killed", close=False, **options))


def mcap_of(run: Path) -> Path:
    """The MCAP file of a run directory, finished or not."""
    return next(path for path in run.iterdir() if path.name.endswith((".mcap", ".active")))


def records_of(data: bytes) -> Iterator[Record]:
    """Every record of a sound file outside of chunks."""
    at = len(MCAP0_MAGIC)
    while at + HEAD_BYTES <= len(data) and data[at:] != MCAP0_MAGIC:
        opcode, length = struct.unpack_from("<BQ", data, at)
        yield Record(opcode, at, at + HEAD_BYTES + length)
        at += HEAD_BYTES + length


def places_of(path: Path, opcode: int) -> list[tuple[int, int]]:
    """First byte and end of each record of a kind."""
    return [(record.begin, record.end) for record in records_of(path.read_bytes()) if record.opcode == opcode]


def spoil(path: Path, at: int, value: bytes | None = None) -> None:
    """Flips a bit, or puts other bytes there."""
    data = path.read_bytes()
    path.write_bytes(_put(at, value or bytes([data[at] ^ 1]), data))


def corpus(sound: Sound) -> Iterator[Case]:
    """All damaged recordings."""
    for run in sound:
        data = mcap_of(run).read_bytes()
        yield from _cut_off(run, data)
        yield from _flipped(run, data)
        yield from _wiped(run, data)
    yield from _lying(sound.finished, mcap_of(sound.finished).read_bytes())
    yield from _foreign(sound.finished)
    yield from _places(sound.finished)


# Bytes


def changed(run: Path, change: Callable[[bytes], bytes], directory: Path) -> Path:
    """A copy of a run directory, its MCAP file changed."""
    target = Path(shutil.copytree(run, directory / run.name))
    path = mcap_of(target)
    path.write_bytes(change(path.read_bytes()))
    return target


def _case(run: Path, name: str, change: Callable[[bytes], bytes]) -> Case:
    return Case(f"{run.name}: {name}", partial(changed, run, change))


def _cut(size: int, data: bytes) -> bytes:
    return data[:size]


def _put(at: int, value: bytes, data: bytes) -> bytes:
    return data[:at] + value + data[at + len(value) :]


def _flip(at: int, bit: int, data: bytes) -> bytes:
    return _put(at, bytes([data[at] ^ 1 << bit]), data)


def _insert(at: int, value: bytes, data: bytes) -> bytes:
    return data[:at] + value + data[at:]


def _remove(begin: int, end: int, data: bytes) -> bytes:
    return data[:begin] + data[end:]


def _by_kind(data: bytes) -> dict[int, list[Record]]:
    found: dict[int, list[Record]] = {}
    for record in records_of(data):
        found.setdefault(record.opcode, []).append(record)
    return found


def _cut_off(run: Path, data: bytes) -> Iterator[Case]:
    """Behind and in the middle of every kind of record, and in both magics; less often in the summary."""
    for size in (3, len(MCAP0_MAGIC), len(data) - 3):
        yield _case(run, f"cut to {size} bytes", partial(_cut, size))
    for opcode, records in _by_kind(data).items():
        record = records[-1]
        sizes = [(record.begin + record.end) // 2]
        if opcode in IN_DATA:
            sizes.append(record.begin + 4)
            yield _case(run, f"cut after the {record.name} at {records[0].begin}", partial(_cut, records[0].end))
        if opcode not in IN_DATA or record != records[0]:
            yield _case(run, f"cut after the {record.name} at {record.begin}", partial(_cut, record.end))
        for size in sizes:
            yield _case(run, f"cut at {size} in a {record.name}", partial(_cut, size))


def _flipped(run: Path, data: bytes) -> Iterator[Case]:
    """A bit of each part of the first record of every kind and, in a finished file, of the last, and of both magics.

    Of the first record of each kind in the data section every bit of the opcode: each makes it look like another kind.
    """
    for at in (0, 5, len(data) - 1):
        yield _case(run, f"bit of byte {at} flipped", partial(_flip, at, 3))
    by_kind = _by_kind(data)
    for opcode, found in by_kind.items():
        for record in sorted({found[0], found[-1]} if run.name == "finished" and opcode in IN_DATA else {found[0]}):
            size = record.end - record.begin - HEAD_BYTES
            # kind; length, a little and much too long; first field, middle, last byte
            places = [(0, 1), (1, 2), (5, 4)]
            places += [(at, at % 8) for at in sorted({HEAD_BYTES, HEAD_BYTES + size // 2, HEAD_BYTES + size - 1})]
            if opcode not in IN_DATA or record != found[0]:
                places = places[::2]
            else:
                places += [(0, bit) for bit in range(8) if bit != 1]
            for offset, bit in places:
                name = f"bit {bit} of byte {offset} of the {record.name} at {record.begin} flipped"
                yield _case(run, name, partial(_flip, record.begin + offset, bit))
    chunk = by_kind[Opcode.CHUNK][0]
    for offset, field in ((8, "start"), (24, "size"), (28, "crc"), (32, "length of the name"), (36, "name")):
        name = f"{field} of the first chunk flipped"
        yield _case(run, name, partial(_flip, chunk.begin + HEAD_BYTES + offset, 1))


def _wiped(run: Path, data: bytes) -> Iterator[Case]:
    """More than a bit: sectors of zeros, bytes that are gone, bytes that came in."""
    for part in (1, 3, 4, 5):
        at = len(data) * part // 6 // 512 * 512
        yield _case(run, f"sector at {at} is zero", partial(_put, at, bytes(512)))
        yield _case(run, f"sector at {at} is gone", partial(_remove, at, at + 512))
    for record in list(records_of(data))[8:24:5]:
        yield _case(run, f"bytes came in at {record.begin}", partial(_insert, record.begin, b"\x06\xff" * 100))
        yield _case(run, f"the {record.name} at {record.begin} is gone", partial(_remove, record.begin, record.end))


# Lies


def chunk_with(codec: bytes, unpacked_bytes: int, packed: bytes, crc: int = 1) -> bytes:
    """A chunk's record that says what it likes."""
    body = (
        struct.pack("<QQQII", 0, 0, unpacked_bytes, crc, len(codec)) + codec + struct.pack("<Q", len(packed)) + packed
    )
    return struct.pack("<BQ", Opcode.CHUNK, len(body)) + body


def zstd_bomb(size: int) -> bytes:
    """A small zstd frame that unpacks to `size` zeros and does not say so."""
    compressor = zstandard.ZstdCompressor().compressobj()
    return b"".join(compressor.compress(bytes(2**20)) for _ in range(size >> 20)) + compressor.flush()


def _lying(run: Path, data: bytes) -> Iterator[Case]:
    """Sizes that are not so, and compressions that nobody knows."""
    chunks = [record for record in records_of(data) if record.opcode == Opcode.CHUNK]
    middle = chunks[1]
    for length in (2**63, 2**40, 65 << 20, 0):
        name = f"a chunk of {length} bytes"
        yield _case(run, name, partial(_put, middle.begin + 1, struct.pack("<Q", length)))
    for name, chunk in (
        ("compressed by brotli", chunk_with(b"brotli", 10, b"x" * 10)),
        ("promises a petabyte", chunk_with(b"zstd", 2**50, b"x" * 10)),
        ("is a bomb", chunk_with(b"zstd", 1000, zstd_bomb(GIB))),
        ("is a bomb that says so", chunk_with(b"zstd", GIB, zstd_bomb(GIB))),
        ("is an lz4 of nothing", chunk_with(b"lz4", 10, b"")),
        ("is not packed and too short", chunk_with(b"", 100, b"x" * 10)),
    ):
        yield _case(run, f"a chunk {name}", partial(_replace, middle, chunk))
        yield _case(run, f"the last chunk {name}", partial(_last, chunks[-1], chunk))
    for opcode, length in ((Opcode.DATA_END, 4), (Opcode.FOOTER, 20)):
        early = struct.pack("<BQ", opcode, length) + bytes(length)
        yield _case(run, f"a {opcode.name.lower()} before a chunk", partial(_insert, middle.begin, early))
    yield Case(f"{run.name}: a record of 65 MiB", partial(_large_record, run))


def _replace(record: Record, other: bytes, data: bytes) -> bytes:
    return data[: record.begin] + other + data[record.end :]


def _last(record: Record, other: bytes, data: bytes) -> bytes:
    return data[: record.begin] + other


def _large_record(run: Path, directory: Path) -> Path:
    """An attachment that is larger than what is read, before the first chunk; sparse, so that no disk is used."""
    target = Path(shutil.copytree(run, directory / run.name))
    path = mcap_of(target)
    data = path.read_bytes()
    at = next(record.begin for record in records_of(data) if record.opcode == Opcode.CHUNK)
    size = 65 << 20
    with path.open("r+b") as file:
        file.seek(at)
        file.truncate()
        file.write(struct.pack("<BQ", Opcode.ATTACHMENT, size))
        file.seek(at + HEAD_BYTES + size)
        file.write(data[at:])
    return target


# Other people's


def _foreign(run: Path) -> Iterator[Case]:
    at = mcap_of(run).read_bytes().index(b"ros2")
    yield _case(run, "profile ros1", partial(_put, at, b"ros1"))
    ours = "fbql_msgs/msg/WorldState"
    for name, *how in (
        ("a ROS 1 recording", "ros1", ("ros1msg", "pkg/Other"), "ros1", True),
        ("messages in JSON", "", ("jsonschema", "Other"), "json", True),
        ("a topic without a schema", "ros2", ("", ""), "cdr", True),
        ("another type", "ros2", ("ros2msg", "pkg/msg/Other"), "cdr", True),
        ("our type with other fields", "ros2", ("ros2msg", ours), "cdr", True),
        ("messages outside of chunks", "ros2", ("ros2msg", "pkg/msg/Other"), "cdr", False),
    ):
        yield Case(name, partial(_written, *how), is_ours=False)
    for name, content in (
        ("0 bytes", b""),
        ("one byte", b"\x89"),
        ("the magic alone", MCAP0_MAGIC),
        ("both magics and nothing else", MCAP0_MAGIC * 2),
        ("zeros", bytes(100_000)),
        ("a database", b"SQLite format 3\0" * 1000),
        ("a text", b"not a recording\n" * 1000),
        ("heads of records without end", b"\x06\xff\xff\x01\x00\x00\x00\x00\x00" * 20_000),
    ):
        yield Case(name, partial(_file_with, content), is_ours=False)


def _written(profile: str, schema: tuple[str, str], encoding: str, is_chunked: bool, directory: Path) -> Path:
    """A sound file of somebody else's; its schema's encoding and type."""
    path = directory / "other.mcap"
    with path.open("wb") as file:
        writer = Writer(file, use_chunking=is_chunked, enable_data_crcs=True)
        writer.start(profile, "somebody")
        described = writer.register_schema(schema[1], schema[0], b"string data\n") if schema[0] else 0
        channel = writer.register_channel("/other", encoding, described)
        for number in range(10):
            data = b"\x00\x01\x00\x00\x02\x00\x00\x00a\x00" if encoding == "cdr" else json.dumps(number).encode()
            writer.add_message(channel, number, data, number + 5, number)
        writer.finish()
    return path


def _file_with(content: bytes, directory: Path) -> Path:
    path = directory / "x.mcap"
    path.write_bytes(content)
    return path


# Other places


def _places(run: Path) -> Iterator[Case]:
    """Directories that lead elsewhere, or whose metadata.yaml is damaged."""
    yield Case("a link out of the directory", partial(_linked, run, "../outside.mcap"), is_ours=False)
    yield Case("a link to itself", partial(_linked, run, f"{mcap_of(run).name}"), is_ours=False)
    yield Case("a link to nowhere", partial(_linked, run, "gone"), is_ours=False)
    yield Case("a link inside of the directory", partial(_linked, run, "log/kept"))
    for name in ("../outside.mcap", "/etc/hostname", "log/../../outside.mcap", "gone.mcap"):
        yield Case(f"metadata.yaml names {name}", partial(_renamed, run, name))
    for text in ("", "[1, 2]", "{", "rosbag2_bagfile_information: 3", "\0", "a: &a [*a]"):
        yield Case(f"metadata.yaml is {text!r}", partial(_with_metadata, run, text))
    yield Case("an empty directory", lambda directory: directory, is_ours=False)
    yield Case("nothing there", lambda directory: directory / "gone", is_ours=False)


def _linked(run: Path, goal: str, directory: Path) -> Path:
    target = Path(shutil.copytree(run, directory / run.name))
    path = mcap_of(target)
    where = target / goal
    shutil.copyfile(path, target / "log" / "kept")
    if goal == "../outside.mcap":
        shutil.copyfile(path, where)
    path.unlink()
    path.symlink_to(os.path.relpath(where, target))
    return target


def _with_metadata(run: Path, text: str, directory: Path) -> Path:
    target = Path(shutil.copytree(run, directory / run.name))
    (target / "metadata.yaml").write_text(text)
    return target


def _renamed(run: Path, name: str, directory: Path) -> Path:
    text = (run / "metadata.yaml").read_text().replace(mcap_of(run).name, name)
    target = _with_metadata(run, text, directory)
    shutil.copyfile(mcap_of(run), directory / "outside.mcap")
    return target


def attachment(name: str, data: bytes) -> bytes:
    """An attachment's record with a CRC that is right."""
    body = (
        struct.pack("<QQI", 0, 0, len(name))
        + name.encode()
        + struct.pack("<I", 0)
        + struct.pack("<Q", len(data))
        + data
    )
    body += struct.pack("<I", zlib.crc32(body))
    return struct.pack("<BQ", Opcode.ATTACHMENT, len(body)) + body


def main(arguments: list[str]) -> int:
    """Makes the corpus in a directory that is not there yet. Gives the exit code."""
    if len(arguments) != 1 or Path(arguments[0]).exists():
        print("usage: damaged_recordings.py DIR, a directory to make", file=sys.stderr)
        return 2
    place = Path(arguments[0])
    place.mkdir(parents=True)
    cases = list(corpus(record_sound(place)))
    with (place / "index.tsv").open("w", encoding="utf-8") as index:
        for number, case in enumerate(cases):
            directory = place / f"{number:03}"
            directory.mkdir()
            index.write(f"{case.name!r}\t{case.make(directory).relative_to(place)}\n")
    print(f"{len(cases)} damaged recordings in {place}")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
