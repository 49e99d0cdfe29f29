"""Writes the undamaged part of a recording to a new run directory, which any bag reader can read to its end."""

from __future__ import annotations

import os
import shutil
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from fbql_common.core.errors import BadInput
from fbql_common.core.recording_names import BAG_RECORD, COMPLETE, GAP_RECORD, LOST, RECOVERY_RECORD, RUN_RECORD
from mcap.records import Attachment

from fbql_recording.bag_metadata import BagTopic, profiles_from_text
from fbql_recording.mcap.reader import Topic
from fbql_recording.mcap.writer import McapWriter, WriterChannel
from fbql_recording.recorder import CHUNK_BYTES, finish_bag
from fbql_recording.recovery.parts import Gap
from fbql_recording.recovery.run_directory_files import RunDirectoryFiles
from fbql_recording.recovery.scan import Scan, SoundMessage
from fbql_recording.run import open_run
from fbql_recording.run_directory import create_run_directory
from fbql_recording.run_files import RunFiles, find_damaged_files

_HASH, _PROFILES = "topic_type_hash", "offered_qos_profiles"


@dataclass
class Recovery:
    """What was recovered, and what is lost."""

    path: Path
    """The new run directory."""
    messages: int = 0
    """Messages in the new recording."""
    steps: int = 0
    """Steps in the new recording."""
    gaps: list[tuple[str, Gap]] = field(default_factory=list[tuple[str, Gap]])
    """The gaps, each with the name of its file."""
    messages_lost: dict[str, int] = field(default_factory=dict[str, int])
    """By topic: a lower bound, unless `is_exact`."""
    is_exact: bool = True
    """Whether `messages_lost` is all; else it is unknown how many more are lost."""
    attachments_lost: list[str] = field(default_factory=list[str])
    """Their names."""
    cut_off: list[str] = field(default_factory=list[str])
    """Names of files that were cut off: it is unknown how much followed."""
    lost_before: list[str] = field(default_factory=list[str])
    """What had already been lost when the source was itself recovered from another recording, in words."""
    notes: list[str] = field(default_factory=list[str])
    """Damage without loss."""

    @property
    def chunks_lost(self) -> int:
        """Number of chunks that are lost."""
        return sum(gap.chunks for _, gap in self.gaps)

    @property
    def is_complete(self) -> bool:
        """Whether nothing is lost."""
        return not (self.gaps or self.messages_lost or self.attachments_lost or self.cut_off or self.lost_before)

    @property
    def lost_words(self) -> str:
        """What is lost, in words."""
        chunks, messages = self.chunks_lost, sum(self.messages_lost.values())
        words = [f"{chunks} chunk{'s' * (chunks != 1)}"] * bool(chunks)
        words += [f"{'' if self.is_exact else 'at least '}{messages} messages"] * bool(messages)
        words += [f"attachment {name}" for name in self.attachments_lost]
        words += ["what came after the end of the file"] * bool(self.cut_off)
        words += [f"when it was recovered before: {what}" for what in self.lost_before]
        return ", ".join(words or ["data outside the known messages"] * bool(self.gaps)) or "nothing"


def recover(source: Path, target: Path | None, progress: Callable[[str], None] = lambda _: None) -> Recovery:
    """Writes the undamaged part of a recording to a new run directory. The recording itself is never changed.

    Args:
        source: a run directory, another bag's, or one MCAP file.
        target: the new directory; beside the source unless given.
        progress: called now and then with a line about the progress; an exception from it ends the recovery and leaves
        nothing behind.

    Raises:
        BadInput: there is nothing to recover, or the new directory can't be made.
        OSError: the new directory, which is its `filename`, could not be written; nothing is left behind.
    """
    files = find_damaged_files(source)
    done = Recovery(target or _beside(source), notes=list(files.warnings))
    scans: list[Scan] = []
    for path in files.recordings:
        try:
            report = lambda scanned, path=path: progress(f"{path.name}: {scanned >> 20} MiB scanned")  # noqa: E731
            scans.append(Scan(path, report, continues=scans[-1] if scans else None))
        except BadInput as error:
            if len(files.recordings) == 1:
                raise
            done.gaps.append((path.name, Gap(0, 0, str(error))))
    done.gaps += [(name, Gap(0, 0, "a file of this recording that is not there")) for name in files.missing]
    done.is_exact = not done.gaps and all(scan.is_exact for scan in scans)
    if not scans:
        raise BadInput(f"{files.directory}: no message in it is sound; there is nothing to recover")
    create_run_directory(done.path)
    try:
        _Writing(files, scans, done).write(progress)
    except BaseException as error:
        # It is ours, and new: half a recording must not look like a whole one.
        shutil.rmtree(done.path, ignore_errors=True)
        if isinstance(error, OSError):
            raise OSError(error.errno, error.strerror, str(done.path)) from error
        raise
    return done


def _beside(source: Path) -> Path:
    """A new name beside the source."""
    source = source.absolute()
    stem = source.name if source.is_dir() else source.name.removesuffix(".active").removesuffix(".mcap")
    names = (f"{stem}_recovered" if count == 1 else f"{stem}_recovered{count}" for count in range(1, 1000))
    return next(source.parent / name for name in names if not os.path.lexists(source.parent / name))


class _Writing:
    """One new recording, as it is written."""

    def __init__(self, files: RunFiles, scans: list[Scan], done: Recovery) -> None:
        self._scans = scans
        self._done = done
        self._beside = RunDirectoryFiles(files.directory)
        self._topics: list[Topic] = []
        self._places: list[dict[int, int]] = []
        """For each file: channel id -> index of its topic."""
        self._about: dict[str, str] = {}
        lost: Counter[str] = Counter()
        for scan in scans:
            name = scan.path.name
            done.notes += [f"{name}: {note}" for note in scan.notes]
            if scan.unchecked:
                done.notes.append(f"{name}: {scan.unchecked} chunks or messages have no CRC: they are used as they are")
            done.gaps += [(name, gap) for gap in scan.gaps]
            done.attachments_lost += [gap.attachment for gap in scan.gaps if gap.attachment]
            lost += Counter(scan.messages_lost)
            if not scan.has_end:
                done.cut_off.append(name)
            for topic in scan.topics.values():
                if topic not in self._topics:
                    self._topics.append(topic)
            self._places.append({channel: self._topics.index(topic) for channel, topic in scan.topics.items()})
        done.messages_lost = dict(sorted(lost.items()))
        self._compare_with(_Expected(files))

    def _compare_with(self, expected: _Expected) -> None:
        """Compares what was found with what metadata.yaml tells. No CRC covers it: it must agree with itself and with
        everything that is known."""
        done = self._done
        kept: Counter[str] = Counter()
        for scan in self._scans:
            for channel, topic in scan.topics.items():
                kept[topic.name] += scan.counts[channel]
        known = kept + Counter(done.messages_lost)
        told = expected.messages
        if told is None or +Counter(told) == +known:
            done.is_exact |= told is not None
            return
        name = "metadata.yaml"
        if any(known[topic] > told.get(topic, 0) for topic in known):
            done.notes.append(f"{name} counts {sum(told.values())} messages, but there were {known.total()}; not used")
        elif not done.is_exact:
            done.messages_lost = {
                topic: told[topic] - kept[topic] for topic in sorted(told) if told[topic] > kept[topic]
            }
            done.is_exact = True
        else:
            why = f"it counts {sum(told.values())} messages, but the files that it names never held more than {known.total()}"
            done.gaps.append((name, Gap(0, 0, why, is_odd=True)))
            done.is_exact = False

    def write(self, progress: Callable[[str], None]) -> None:
        """Writes the directory. Raises OSError."""
        done = self._done
        path = done.path / f"{done.path.name}_0.mcap"
        active = path.with_name(f"{path.name}.active")
        with active.open("xb", buffering=0) as file:
            writer = McapWriter(_all_of(file.write), [_channel(topic) for topic in self._topics], CHUNK_BYTES)
            self._write_contents(writer, progress)
            topics = [
                BagTopic(
                    topic.name,
                    topic.type_name,
                    topic.metadata.get(_HASH, ""),
                    profiles_from_text(topic.metadata.get(_PROFILES, "")),
                    count,
                )
                for topic, count in zip(self._topics, writer.counts, strict=True)
            ]
            # metadata.yaml comes last: a directory that has it is whole.
            self._beside.write_to(done.path, done.is_complete)
            finish_bag(writer, file.fileno(), active, path, topics, self._about)
        done.messages = sum(writer.counts)
        progress("reading what was written")
        try:
            done.steps = self._beside.write_summary(open_run(done.path), done.messages)
        except BadInput as error:
            done.notes.append(f"it has no steps that can be read: {error}")

    # What is written

    def _write_contents(self, writer: McapWriter, progress: Callable[[str], None]) -> None:
        attachments, about = self._in_front()
        restored = self._beside.attachments(attachments)
        done = self._done
        for attachment in restored:
            if attachment.name in done.attachments_lost:
                done.attachments_lost.remove(attachment.name)
                done.gaps = [entry for entry in done.gaps if entry[1].attachment != attachment.name]
                done.notes.append(f"attachment {attachment.name} was damaged; it is taken from the run directory")
        self._about = self._beside.about(about, done.notes)
        if self._about:
            writer.add_metadata(RUN_RECORD, self._about)
        writer.add_metadata(RECOVERY_RECORD, self._story())
        for attachment in restored:
            writer.add_attachment(attachment.name, attachment.media_type, attachment.data)
        written = 0
        for scan, places in zip(self._scans, self._places, strict=True):
            gap: Gap | None = None
            for content in scan.contents():
                if isinstance(content, SoundMessage):
                    if gap is not None:
                        writer.add_metadata(GAP_RECORD, _words_of(gap))
                        gap = None
                    channel, sequence, log_time_ns, publish_time_ns, data = content
                    writer.add_message(places[channel], data, log_time_ns, publish_time_ns, sequence)
                    written += 1
                    if written % 4096 == 0:
                        progress(f"{written} messages written")
                elif isinstance(content, Attachment):
                    writer.add_attachment(
                        content.name, content.media_type, content.data, content.log_time, content.create_time
                    )
                elif isinstance(content, Gap):
                    gap = content if content.is_between_messages else gap
                elif content.name not in (BAG_RECORD, RUN_RECORD, RECOVERY_RECORD):
                    writer.add_metadata(content.name, content.metadata)
            if scan is not self._scans[-1] and not scan.has_end:
                writer.add_metadata(GAP_RECORD, {"why": f"{scan.path.name} was cut off"})
        writer.flush()

    def _in_front(self) -> tuple[dict[str, Attachment], dict[str, str]]:
        """The attachments, by name, and the recording's description of its run."""
        attachments: dict[str, Attachment] = {}
        about: dict[str, str] = {}
        for scan in self._scans:
            for record in scan.records():
                if isinstance(record, Attachment):
                    attachments.setdefault(record.name, record)
                elif record.name == RUN_RECORD and not about:
                    about = record.metadata
                elif record.name == RECOVERY_RECORD and record.metadata.get(COMPLETE) != "true":
                    self._done.lost_before.append(record.metadata.get(LOST, "something"))
        return attachments, about

    def _story(self) -> dict[str, str]:
        done = self._done
        return {
            "from": " ".join(scan.path.name for scan in self._scans),
            COMPLETE: str(done.is_complete).lower(),
            LOST: done.lost_words,
            "chunks_lost": str(done.chunks_lost),
            "messages_lost": str(sum(done.messages_lost.values())),
        }


def _all_of(write: Callable[[Any], int | None]) -> Callable[[bytes], None]:
    """Writes everything: an unbuffered file may write less at a time."""

    def write_all(data: bytes) -> None:
        rest = memoryview(data)
        while rest:
            rest = rest[write(rest) or 0 :]

    return write_all


def _channel(topic: Topic) -> WriterChannel:
    return WriterChannel(
        topic.name, topic.type_name, topic.schema, topic.metadata, topic.message_encoding, topic.schema_encoding
    )


def _words_of(gap: Gap) -> dict[str, str]:
    times = {"start_ns": gap.start_ns, "end_ns": gap.end_ns}
    return {"why": gap.why, **{name: str(value) for name, value in times.items() if value is not None}}


class _Expected:
    """The numbers of messages in metadata.yaml, which was written when the recording was complete."""

    def __init__(self, files: RunFiles) -> None:
        self.messages: dict[str, int] | None = None
        """By topic; None where it tells nothing, or contradicts itself."""
        found: dict[str, int] = {}
        try:
            for entry in files.information["topics_with_message_count"]:
                name, count = entry["topic_metadata"]["name"], entry["message_count"]
                if not isinstance(name, str) or type(count) is not int or count < 0 or name in found:
                    return
                found[name] = count
            if sum(found.values()) == files.information["message_count"]:
                self.messages = found
        except (TypeError, KeyError):
            return
