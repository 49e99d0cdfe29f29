"""Recordings damaged at random in known ways, and a judge that compares what recovery says with what is true."""

from __future__ import annotations

import random
import struct
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

from damaged_recordings import HEAD_BYTES, Record, mcap_of, records_of
from fbql_recording.mcap.reader import Message
from fbql_recording.recovery.recover import Recovery
from fbql_recording.run import open_run
from mcap.opcode import Opcode
from mcap_contents import Chunk, Contents, bytes_of, contents_of
from recorded_match import record_match

EXTREMES = (0, 1, 2**16, 2**31, 2**32 - 1, 2**63, 2**64 - 1)


class Original(NamedTuple):
    """A sound recording, and everything that is true of it."""

    data: bytes
    """The MCAP file."""
    messages: list[Message]
    chunks: int
    other: bytes
    """The MCAP file of another run."""


def record_originals(place: Path) -> dict[str, Original]:
    """A finished recording of a few short episodes, what SIGKILL leaves of it, and a split one's second part.

    Each is given with the recording of another seed, for parts that do not belong there.
    """
    options = {"max_steps": 8, "episodes": 4, "restart_at": {1: (3, 0)}, "controller": "subsumption"}
    found: dict[str, Original] = {}
    for name, close in (("finished", True), ("killed", False)):
        run = record_match(place / name, close=close, **options)
        other = record_match(place / f"other_{name}", close=close, **{**options, "seed": 4, "max_steps": 11})
        data = mcap_of(run).read_bytes()
        chunks = sum(record.opcode == Opcode.CHUNK for record in records_of(data))
        found[name] = Original(data, list(open_run(run).messages()), chunks, mcap_of(other).read_bytes())
    finished = found["finished"]
    for name, options in STORED.items():
        data, other = (bytes_of(_stored(contents_of(each), **options)) for each in (finished.data, finished.other))
        found[name] = finished._replace(data=data, other=other)
    return found


STORED: dict[str, dict[str, Any]] = {
    "no summary": {"has_summary": False},
    "no statistics": {"has_statistics": False},
    "no message indexes": {"has_indexes": False},
    "no counts": {"has_statistics": False, "has_indexes": False},
    "no chunk indexes": {"has_chunk_indexes": False},
    "descriptions alone": {"has_chunk_indexes": False, "has_statistics": False},
    "not compressed": {"codec": ""},
    "lz4": {"codec": "lz4"},
}
"""How other writers store the same: what they may leave out, and compressions."""


def _stored(contents: Contents, codec: str | None = None, **options: bool) -> Contents:
    for part in contents.data:
        if isinstance(part, Chunk) and codec is not None:
            part.codec = codec
    return replace(contents, **options)


# How a file is damaged: each function gives the changed bytes


def blocks_of(data: bytes) -> list[tuple[int, int]]:
    """First byte and end of each record; a chunk and its message indexes are one."""
    blocks: list[tuple[int, int]] = []
    for record in records_of(data):
        if record.opcode == Opcode.MESSAGE_INDEX and blocks:
            blocks[-1] = blocks[-1][0], record.end
        else:
            blocks.append((record.begin, record.end))
    return blocks


def chunks_of(data: bytes) -> list[tuple[int, int]]:
    """The blocks that begin with a chunk."""
    return [block for block in blocks_of(data) if data[block[0]] == Opcode.CHUNK]


def _flip(rng: random.Random, data: bytes, _: bytes) -> bytes:
    changed = bytearray(data)
    for _ in range(rng.choice((1, 1, 2, 5))):
        changed[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
    return bytes(changed)


def _record(rng: random.Random, data: bytes) -> Record:
    """A record; a rare kind as likely as a frequent one."""
    records = list(records_of(data))
    kind = rng.choice(sorted({record.opcode for record in records}))
    return rng.choice([record for record in records if record.opcode == kind])


def _flip_head(rng: random.Random, data: bytes, _: bytes) -> bytes:
    """A bit at the beginning of a record: its kind, length and first fields."""
    record = _record(rng, data)
    at = record.begin + rng.randrange(min(HEAD_BYTES + 44, record.end - record.begin))
    return data[:at] + bytes([data[at] ^ 1 << rng.randrange(8)]) + data[at + 1 :]


def _extreme(rng: random.Random, data: bytes, _: bytes) -> bytes:
    """A field at the beginning of a record becomes very small or very large."""
    record = _record(rng, data)
    at = record.begin + rng.choice((1, 9, 17, 25, 33))
    return data[:at] + struct.pack("<Q", rng.choice(EXTREMES)) + data[at + 8 :] if at + 8 <= len(data) else data


def _zero(rng: random.Random, data: bytes, _: bytes) -> bytes:
    at = rng.randrange(len(data))
    size = min(rng.choice((1, 16, 512, 4096)), len(data) - at)
    return data[:at] + bytes(size) + data[at + size :]


def _cut(rng: random.Random, data: bytes, _: bytes) -> bytes:
    return data[: rng.randrange(len(data))]


def _remove_bytes(rng: random.Random, data: bytes, _: bytes) -> bytes:
    at = rng.randrange(len(data))
    return data[:at] + data[at + rng.choice((1, 7, 512)) :]


def _insert_bytes(rng: random.Random, data: bytes, _: bytes) -> bytes:
    at = rng.randrange(len(data))
    return data[:at] + rng.randbytes(rng.choice((1, 9, 300))) + data[at:]


def _delete(rng: random.Random, data: bytes, _: bytes) -> bytes:
    begin, end = rng.choice(blocks_of(data))
    return data[:begin] + data[end:]


def _delete_record(rng: random.Random, data: bytes, _: bytes) -> bytes:
    record = _record(rng, data)
    return data[: record.begin] + data[record.end :]


def _delete_chunk(rng: random.Random, data: bytes, _: bytes) -> bytes:
    begin, end = rng.choice(chunks_of(data) or blocks_of(data))
    return data[:begin] + data[end:]


def _duplicate(rng: random.Random, data: bytes, _: bytes) -> bytes:
    blocks = blocks_of(data)
    begin, end = rng.choice(blocks)
    at = rng.choice((end, rng.choice(blocks)[0]))
    return data[:at] + data[begin:end] + data[at:]


def _duplicate_chunk(rng: random.Random, data: bytes, _: bytes) -> bytes:
    begin, end = rng.choice(chunks_of(data) or blocks_of(data))
    return data[:end] + data[begin:end] + data[end:]


def _swap(rng: random.Random, data: bytes, _: bytes) -> bytes:
    blocks = rng.choice((blocks_of(data), chunks_of(data)))
    if len(blocks) < 2:
        return data
    (a, b), (c, d) = sorted(rng.sample(blocks, 2))
    return data[:a] + data[c:d] + data[b:c] + data[a:b] + data[d:]


def _replace_chunk(rng: random.Random, data: bytes, other: bytes) -> bytes:
    """Another run's chunk in the place of one."""
    ours, theirs = chunks_of(data), chunks_of(other)
    if not ours:
        return data
    (begin, end), (a, b) = rng.choice(ours), rng.choice(theirs)
    return data[:begin] + other[a:b] + data[end:]


def _insert_chunk(rng: random.Random, data: bytes, other: bytes) -> bytes:
    at = rng.choice(blocks_of(data) or [(0, 0)])[0]
    a, b = rng.choice(chunks_of(other))
    return data[:at] + other[a:b] + data[at:]


def _append(rng: random.Random, data: bytes, other: bytes) -> bytes:
    return data + other


def _damage_two_neighbours(rng: random.Random, data: bytes, _: bytes) -> bytes:
    chunks = chunks_of(data)
    if len(chunks) < 2:
        return data
    number = rng.randrange(len(chunks) - 1)
    changed = bytearray(data)
    for begin, _end in chunks[number : number + 2]:
        (length,) = struct.unpack_from("<Q", data, begin + 1)
        changed[begin + HEAD_BYTES + rng.randrange(max(1, min(length, 10_000)))] ^= 1 << rng.randrange(8)
    return bytes(changed)


Mutation = Callable[[random.Random, bytes, bytes], bytes]
MUTATIONS: tuple[Mutation, ...] = (
    *(_flip, _flip, _flip_head, _flip_head, _extreme, _zero, _cut, _remove_bytes, _insert_bytes),
    *(_delete, _delete_record, _delete_chunk, _duplicate, _duplicate_chunk, _swap, _replace_chunk, _insert_chunk),
    *(_append, _damage_two_neighbours),
)


def mutated(seed: int, original: Original) -> tuple[str, bytes]:
    """One to three damages: what they are, and the damaged file."""
    rng = random.Random(seed)
    data, names = original.data, list[str]()
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        mutation = rng.choice(MUTATIONS)
        names.append(mutation.__name__.lstrip("_"))
        try:
            data = mutation(rng, data, original.other) or data[:1]
        except (struct.error, IndexError, ValueError):
            names[-1] += " (not possible any more)"
    return ", ".join(names), data


# What is true


def untruths(original: Original, found: Recovery) -> Iterator[str]:
    """What a recovery says that is not so, one line each."""
    run = open_run(found.path)
    told, rest = list(run.messages()), iter(original.messages)
    lost = Counter(original.messages) - Counter(told)
    strangers = Counter(told) - Counter(original.messages)
    by_topic = Counter(dict.fromkeys({message.topic for message in original.messages}, 0))
    for message, count in lost.items():
        by_topic[message.topic] += count
    # Without an end only numbers and steps tell what belongs to a recording: another one's may fit. It is never exact.
    if strangers and (found.is_complete or found.is_exact):
        yield f"{strangers.total()} messages were never recorded, or are there twice"
    elif not (strangers or any("out of sequence" in gap.why for _, gap in found.gaps)) and not all(
        message in rest for message in told
    ):
        yield "the messages are in another order"
    if found.is_complete and (lost or strangers):
        yield f"complete, but {lost.total()} messages are lost"
    # Of a channel whose description is lost only the number is known; without a CRC the name may be damaged.
    undescribed = sum(count for topic, count in found.messages_lost.items() if topic not in by_topic)
    if undescribed > sum(count for topic, count in by_topic.items() if topic not in found.messages_lost):
        yield f"{undescribed} messages of topics that are not described lost"
    for topic in by_topic:
        count = found.messages_lost.get(topic, 0)
        if count > by_topic[topic] or (found.is_exact and count != by_topic[topic]):
            yield f"{topic}: {count} {'' if found.is_exact else 'or more '}lost, but {by_topic[topic]} are"
    if found.messages != len(told):
        yield f"{found.messages} messages, but {len(told)} are there"
    if found.chunks_lost > original.chunks:
        yield f"{found.chunks_lost} chunks lost of {original.chunks}"
    times = {message.log_time_ns for message in (lost if found.is_exact else original.messages)}
    for _, gap in found.gaps:
        # Without an end, a damaged chunk may be another recording's: then its time is only one that can be.
        if gap.start_ns is not None and gap.end_ns is not None and gap.messages.total():
            if found.is_exact and not (gap.start_ns in times and gap.end_ns in times):
                yield f"a gap from {gap.start_ns} to {gap.end_ns} ns, where no messages are lost"
            elif not gap.start_ns <= gap.end_ns <= max(times) + 10**9:
                yield f"a gap from {gap.start_ns} to {gap.end_ns} ns, which can't be"
