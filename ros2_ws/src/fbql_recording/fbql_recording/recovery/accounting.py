"""Which parts of a scanned file belong together, in which order, and what is missing.

Two things are believed, because CRCs cover them: a summary whose CRC matches, which lists every chunk, attachment and
Metadata record; and the numbers of the messages in sound chunks, which our own recorder counts from 1 for each channel.
Nothing else is counted as more than a lower bound.
"""

from __future__ import annotations

import operator
from collections import Counter, deque
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from fbql_common.core.recording_names import BAG_RECORD, GAP_RECORD, RUN_RECORD
from mcap.opcode import Opcode
from mcap.records import ChunkIndex

from fbql_recording.mcap.format import HEAD, McapSummary
from fbql_recording.recovery.parts import Found, Gap, Span
from fbql_recording.recovery.step_order import StepRange, break_between


@dataclass
class Ending:
    """How a file ends, for the one that continues it."""

    numbers: dict[int, int] = field(default_factory=dict[int, int])
    """Number of the last message by channel id; empty where messages are not numbered."""
    steps: StepRange | None = None


def chunks_in(found: Found) -> Iterator[tuple[int, Span]]:
    """The sound chunks, with their places."""
    for place, part in enumerate(found):
        if isinstance(part, Span) and part.opcode == Opcode.CHUNK:
            yield place, part


def drop_copies(found: Found) -> None:
    """Leaves out every chunk that is a copy of an earlier one."""
    known: dict[tuple[str, int, int, bytes], int] = {}
    for place, chunk in list(chunks_in(found)):
        if known.setdefault(chunk.identity, chunk.begin) != chunk.begin:
            first = known[chunk.identity]
            why = f"the chunk at byte {chunk.begin} is a copy of the one at byte {first}; it is left out"
            found[place] = Gap(chunk.begin, chunk.end, why, is_between_messages=False, is_odd=True)


def check_steps(found: Found, before: StepRange | None) -> StepRange | None:
    """Adds a gap wherever steps do not follow each other, and none explains it; returns the last steps.

    Args:
        found: in its final order; changed.
        before: the last steps of the file that this one continues.
    """
    checked: Found = []
    is_explained = False
    for part in found:
        if isinstance(part, Gap):
            is_explained |= part.is_between_messages
        elif part.name == GAP_RECORD and part.opcode == Opcode.METADATA:
            is_explained = True
        elif part.steps is not None:
            words = list(part.steps.breaks)
            if before is not None and not is_explained and (here := break_between(before, part.steps)):
                words.insert(0, here)
            checked += [
                Gap(part.begin, part.begin, f"at byte {part.begin}: {each}, out of sequence", is_odd=True)
                for each in words
            ]
            before, is_explained = part.steps, False
        checked.append(part)
    found[:] = checked
    return before


# By the summary


def compare_with_summary(found: Found, summary: McapSummary, *, is_displaced: bool) -> None:
    """Leaves out what the summary does not list, puts chunks in its order, and describes every gap by it.

    Args:
        found: changed; the gaps in which nothing is lost have neither chunks, messages, nor a name.
        summary: its CRC matches.
        is_displaced: whether the parts need not begin at the bytes that it states.
    """
    for part in found:
        if isinstance(part, Gap):
            part.chunks, part.start_ns, part.end_ns = 0, None, None
            part.messages.clear()
            part.attachment, part.is_between_messages = "", False
    if summary.chunks:
        _match_chunks(found, summary, is_displaced)
    attachments = {begin: index.name for begin, index in summary.attachments.items()}
    for gap, name in _missing(found, Opcode.ATTACHMENT, attachments, is_displaced):
        gap.attachment = name
    metadata = {begin: index.name for begin, index in summary.metadata.items()}
    for gap, name in _missing(found, Opcode.METADATA, metadata, is_displaced):
        gap.is_between_messages |= name not in (BAG_RECORD, RUN_RECORD)
        gap.is_odd |= name != BAG_RECORD


def lists_most(found: Found, summary: McapSummary) -> bool:
    """Whether a summary lists most of the sound chunks: else it is another recording's."""
    listed = {_identity(entry) for entry in summary.chunks.values()}
    chunks = {chunk.identity: _identity_of(chunk) in listed for _, chunk in chunks_in(found)}
    return not summary.chunks or 2 * sum(chunks.values()) >= len(chunks)


def _match_chunks(found: Found, summary: McapSummary, is_displaced: bool) -> None:
    entries = sorted(summary.chunks.values(), key=lambda entry: entry.chunk_start_offset)
    free: dict[tuple[Any, ...], deque[int]] = {}
    for number, entry in enumerate(entries):
        free.setdefault(_identity(entry), deque()).append(number)
    numbers: dict[int, int] = {}
    """Place in `found` -> number of its entry."""
    seen: set[tuple[str, int, int, bytes]] = set()
    for place, chunk in list(chunks_in(found)):
        matching = free.get(_identity_of(chunk))
        if matching:
            numbers[place] = matching.popleft()
        else:
            is_copy = chunk.identity in seen
            why = "there already" if is_copy else "not a part of this recording, which does not list it"
            why = f"the chunk at byte {chunk.begin} is {why}; it is left out"
            found[place] = Gap(chunk.begin, chunk.end, why, is_between_messages=False, is_odd=True)
        seen.add(chunk.identity)
    _put_in_order(found, numbers)
    lost = sorted(number for rest in free.values() for number in rest)
    _place_lost_chunks(found, entries, lost, numbers, is_displaced)


def _identity(entry: ChunkIndex) -> tuple[Any, ...]:
    return (
        entry.compression,
        entry.compressed_size,
        entry.uncompressed_size,
        entry.message_start_time,
        entry.message_end_time,
    )


def _identity_of(chunk: Span) -> tuple[Any, ...]:
    codec, packed, size, _ = chunk.identity
    return codec, packed, size, chunk.start_ns, chunk.end_ns


def _put_in_order(found: Found, order: dict[int, int]) -> None:
    """Sorts the chunks at these places by their numbers; each that was out of its place becomes a gap as well."""
    places = sorted(order)
    chunks = sorted(((order[place], found[place]) for place in places), key=operator.itemgetter(0))
    most = -1
    moved: dict[int, Gap] = {}
    for place in places:
        part = found[place]
        if order[place] < most:
            why = f"the chunk at byte {part.begin} was not in its place, to which it is returned"
            moved[order[place]] = Gap(part.begin, part.begin, why, is_odd=True)
        most = max(most, order[place])
    for place, (number, chunk) in zip(places, chunks, strict=True):
        found[place] = chunk
        order[place] = number
    for place, (number, _) in reversed(list(zip(places, chunks, strict=True))):
        if number in moved:
            found.insert(place, moved[number])
    if moved:
        shift = 0
        for place in places:
            number = order.pop(place)
            shift += number in moved
            order[place + shift] = number


def _place_lost_chunks(
    found: Found, entries: list[ChunkIndex], lost: list[int], numbers: dict[int, int], is_displaced: bool
) -> None:
    """Describes the gaps by the chunks that are lost; where there is no gap for one, it is added."""
    places = {number: place for place, number in numbers.items()}
    after = sorted(places)
    used: set[int] = set()
    added: list[tuple[int, Gap]] = []
    for number in lost:
        entry = entries[number]
        begin = max((places[other] + 1 for other in after if other < number), default=0) if is_displaced else 0
        end = min((places[other] for other in after if other > number), default=len(found)) if is_displaced else 0
        gap = _gap_for(found, entry.chunk_start_offset, Opcode.CHUNK, range(begin, end), used, is_displaced)
        if gap is None:
            lower = [places[other] for other in after if other < number]
            gap = Gap(
                entry.chunk_start_offset, entry.chunk_start_offset, f"chunk {number + 1} of the file is not there"
            )
            added.append((max(lower, default=-1) + 1, gap))
        gap.chunks += 1
        gap.messages += messages_in_chunk(entry)
        gap.is_between_messages = True
        start, stop = entry.message_start_time, entry.message_end_time
        gap.start_ns = start if gap.start_ns is None else min(start, gap.start_ns)
        gap.end_ns = stop if gap.end_ns is None else max(stop, gap.end_ns)
    for place, gap in sorted(added, key=operator.itemgetter(0), reverse=True):
        found.insert(place, gap)


def _gap_for(found: Found, offset: int, opcode: int, within: range, used: set[int], is_displaced: bool) -> Gap | None:
    """The gap in which a record is lost: by its byte, or among the gaps at these places."""
    if not is_displaced:
        gaps = [part for part in found if isinstance(part, Gap) and part.begin <= offset < part.end]
        return next((gap for gap in gaps if not gap.is_odd), gaps[0] if gaps else None)
    gaps = [found[place] for place in within]
    free = [gap for gap in gaps if isinstance(gap, Gap) and not gap.is_odd and id(gap) not in used]
    gap = next((gap for gap in free if gap.opcode == opcode), None) or next(iter(free), None)
    if gap is not None:
        used.add(id(gap))
    return gap


def _missing(found: Found, opcode: int, names: Mapping[int, str], is_displaced: bool) -> Iterator[tuple[Gap, str]]:
    """The records of a kind that the summary lists and that are lost, each with its gap, which is added if need be."""
    there: Counter[str] = Counter()
    begins: dict[int, str] = {}
    for part in found:
        if isinstance(part, Span) and part.opcode == opcode:
            there[part.name] += 1
            begins[part.begin] = part.name
    used: set[int] = set()
    # Those that are where they should be are not the lost ones of their name.
    for begin in sorted(names, key=lambda begin: begins.get(begin) != names[begin]):
        name = names[begin]
        if there[name]:
            there[name] -= 1
            continue
        gap = _gap_for(found, begin, opcode, range(len(found)), used, is_displaced)
        if gap is None or gap.attachment or gap.chunks:
            kind = "attachment" if opcode == Opcode.ATTACHMENT else "note"
            gap = Gap(begin, begin, f"the {kind} '{name}' is not there", opcode, is_between_messages=False)
            found.append(gap)
        yield gap, name


def messages_in_chunk(chunk: ChunkIndex) -> Counter[int]:
    """Messages of a chunk by channel id: the sizes of its message indexes, which follow each other, give the
    numbers."""
    begins = sorted((begin, channel) for channel, begin in chunk.message_index_offsets.items())
    ends = [begin for begin, _ in begins[1:]]
    ends.append(chunk.chunk_start_offset + chunk.chunk_length + chunk.message_index_length)
    sizes = {channel: end - begin - HEAD.size - 6 for (begin, channel), end in zip(begins, ends, strict=False)}
    return Counter({channel: size // 16 for channel, size in sizes.items() if size > 0 and size % 16 == 0})


# By the numbers of the messages


def order_by_numbers(found: Found) -> None:
    """Puts numbered chunks in their order, which is that of their times, and leaves out those that contradict it."""
    places = [place for place, _ in chunks_in(found)]
    chunks = sorted((chunk for _, chunk in chunks_in(found)), key=lambda chunk: (chunk.start_ns, chunk.end_ns))
    kept: list[Span] = []
    dropped: set[int] = set()
    for number, chunk in enumerate(chunks):
        following = chunks[number + 1] if number + 1 < len(chunks) else None
        while kept and _contradict(kept[-1], chunk):
            before = kept[-2] if len(kept) > 1 else None
            fits_last = _joins(before, kept[-1]) + _joins(kept[-1], following)
            fits_this = _joins(before, chunk) + _joins(chunk, following)
            is_this_later = chunk.begin > kept[-1].begin
            if fits_this > fits_last or (fits_this == fits_last and not is_this_later):
                dropped.add(kept.pop().begin)
                continue
            dropped.add(chunk.begin)
            break
        else:
            kept.append(chunk)
    for place in places:
        part = found[place]
        if part.begin in dropped:
            why = f"the chunk at byte {part.begin} does not fit between the others by the numbers of its messages"
            found[place] = Gap(part.begin, part.end, f"{why}; it is left out", is_odd=True)
    ranks = {chunk.begin: rank for rank, chunk in enumerate(kept)}
    _put_in_order(found, {place: ranks[found[place].begin] for place, _ in chunks_in(found)})


def _contradict(before: Span, after: Span) -> bool:
    return any(channel in before.last and after.first[channel] <= before.last[channel] for channel in after.first)


def _joins(before: Span | None, after: Span | None) -> int:
    """Whether one chunk continues another without a gap; None before: it begins the file."""
    if after is None:
        return 0
    if before is None:
        return int(all(number == 1 for number in after.first.values()))
    if any(after.first[channel] != before.last.get(channel, 0) + 1 for channel in after.first):
        return 0
    return int(before.steps is None or after.steps is None or not break_between(before.steps, after.steps))


def count_by_numbers(found: Found, before: Mapping[int, int] | None) -> dict[int, int]:
    """Counts the messages that are missing before each numbered chunk; returns the numbers of the last messages.

    Args:
        found: in its final order; changed.
        before: numbers of the last messages before the file; empty: each channel counts from 1; None: not known.
    """
    last: dict[int, int] = dict(before or {})
    is_known = before is not None
    counted: Found = []
    waiting: list[Gap] = []
    """Gaps since the last chunk."""
    for part in found:
        if isinstance(part, Gap):
            counted.append(part)
            if not part.attachment and not part.is_odd:
                waiting.append(part)
            continue
        if part.name == GAP_RECORD and part.opcode == Opcode.METADATA:
            last, is_known, waiting = {}, False, []  # recovered before: what the numbers lack here is known to be lost
        if part.opcode == Opcode.CHUNK:
            missing: Counter[int] = Counter()
            for channel, number in part.first.items():
                reached = last.get(channel, 0 if is_known else number - 1)
                missing[channel] = number - reached - 1 + part.last[channel] - number + 1 - part.counts[channel]
            _tell(counted, waiting, +missing, part)
            last.update(part.last)
            waiting = []
        counted.append(part)
    found[:] = counted
    return last


def _tell(counted: Found, waiting: list[Gap], missing: Counter[int], chunk: Span) -> None:
    """Puts the number of missing messages into the gaps before a chunk."""
    if not missing:
        for gap in waiting:
            gap.chunks, gap.start_ns, gap.end_ns = 0, None, None
            gap.messages.clear()
        return
    if not waiting:
        why = f"messages before byte {chunk.begin} are not there"
        counted.append(Gap(chunk.begin, chunk.begin, why, messages=missing))
        return
    told = sum((gap.messages for gap in waiting), Counter[int]())
    if told == missing:
        return
    # Only the sum is known: the gaps become one.
    first, *others = waiting
    first.messages = missing
    for gap in others:
        first.end = max(first.end, gap.end)
        first.why = f"{first.why}; {gap.why}" if len(first.why) < 400 else first.why
        first.chunks += gap.chunks
        counted.remove(gap)
    # Heads and indexes that tell another number need not be this recording's.
    first.start_ns, first.end_ns = None, None
