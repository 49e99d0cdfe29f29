"""What is sound in a damaged recording, written as a new run directory that every reader of bags reads completely."""

from __future__ import annotations

import os
import shutil
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from fbql_common.core.errors import BadInput
from fbql_common.core.recording_names import COMPLETE, GAP_RECORD, LOST, RECOVERY_RECORD, RUN_RECORD
from mcap.records import Attachment

from fbql_recording import Topic, open_run
from fbql_recording.bag_metadata import BagTopic, profiles_from_text
from fbql_recording.mcap.writer import McapWriter, WriterChannel
from fbql_recording.recorder import BAG_RECORD, CHUNK_BYTES, finish_bag
from fbql_recording.recovery.run_directory_files import RunDirectoryFiles
from fbql_recording.recovery.survey import Loss, SoundMessage, Survey
from fbql_recording.run_directory import create_run_directory
from fbql_recording.run_files import RunFiles, find_damaged_files

_HASH, _PROFILES = "topic_type_hash", "offered_qos_profiles"


@dataclass
class Recovery:
    """What became of it."""

    path: Path
    """The new run directory."""
    messages: int = 0
    chunks_lost: int = 0
    messages_lost: dict[str, int] = field(default_factory=dict[str, int])
    """By topic: at least so many."""
    losses: list[tuple[str, Loss]] = field(default_factory=list[tuple[str, Loss]])
    """Each with the name of its file."""
    attachments_lost: list[str] = field(default_factory=list[str])
    cut_off: list[str] = field(default_factory=list[str])
    """Names of files without an end: how much came after what is there nobody knows."""
    lost_before: list[str] = field(default_factory=list[str])
    """What was lost already when the source was recovered from another recording, in words."""
    notes: list[str] = field(default_factory=list[str])
    """What was damaged and cost nothing."""
    steps: int = 0
    """Steps in the new recording."""

    @property
    def is_complete(self) -> bool:
        """Whether nothing is lost."""
        return not (self.losses or self.messages_lost or self.attachments_lost or self.cut_off or self.lost_before)

    @property
    def lost_words(self) -> str:
        """What is lost, in words."""
        chunks, messages = self.chunks_lost, sum(self.messages_lost.values())
        words = [f"{chunks} chunk{'s' * (chunks != 1)}"] * bool(chunks)
        words += [f"at least {messages} messages"] * bool(messages)
        words += [f"attachment {name}" for name in self.attachments_lost]
        words += ["what came after the end of the file"] * bool(self.cut_off)
        words += [f"when it was recovered before: {what}" for what in self.lost_before]
        return ", ".join(words or ["something that no message tells of"] * bool(self.losses)) or "nothing"


def recover(source: Path, target: Path | None, progress: Callable[[str], None]) -> Recovery:
    """Writes what is sound in a recording to a new run directory.

    Args:
        source: a run directory, another bag's, or one MCAP file.
        target: the new directory; beside the source unless given.
        progress: told in words how far it is, now and then; what it raises ends the recovery and leaves nothing behind.

    Raises:
        BadInput: nothing is there to be recovered, or the new directory can't be made.
        OSError: it could not be written; nothing is left behind.
    """
    files = find_damaged_files(source)
    surveys, notes, unusable = _surveys(files, progress)
    target = target or _beside(source)
    create_run_directory(target)
    try:
        return _Writing(files, surveys, notes, unusable, target).write(progress)
    except BaseException:
        # It is ours, and new: half a recording must not look like one.
        shutil.rmtree(target, ignore_errors=True)
        raise


def _surveys(
    files: RunFiles, progress: Callable[[str], None]
) -> tuple[list[Survey], list[str], list[tuple[str, Loss]]]:
    """What is sound in each file; notes; files in which nothing is. Raises BadInput where that is none of them."""
    surveys: list[Survey] = []
    unusable: list[tuple[str, Loss]] = []
    for path in files.recordings:
        try:
            survey = Survey(path, lambda done, path=path: progress(f"{path.name}: {done >> 20} MiB gone through"))
            surveys.append(survey)
        except BadInput as error:
            if len(files.recordings) == 1:
                raise
            unusable.append((path.name, Loss(0, 0, str(error))))
    if not surveys:
        raise BadInput(f"{files.directory}: no message in it is sound; there is nothing to recover")
    return surveys, list(files.warnings), unusable


def _beside(source: Path) -> Path:
    """A new name beside the source."""
    source = source.absolute()
    stem = source.name if source.is_dir() else source.name.removesuffix(".active").removesuffix(".mcap")
    names = (f"{stem}_recovered" if count == 1 else f"{stem}_recovered{count}" for count in range(1, 1000))
    return next(source.parent / name for name in names if not os.path.lexists(source.parent / name))


class _Writing:
    """One new recording, as it is written."""

    def __init__(
        self,
        files: RunFiles,
        surveys: Sequence[Survey],
        notes: list[str],
        unusable: list[tuple[str, Loss]],
        target: Path,
    ) -> None:
        self._files = files
        self._surveys = surveys
        self._target = target
        self._beside = RunDirectoryFiles(files.directory)
        self._done = Recovery(target, notes=notes, losses=unusable)
        self._topics: list[Topic] = []
        self._places: list[dict[int, int]] = []
        """For each file: channel id -> index of its topic."""
        self._about: dict[str, str] = {}

    def write(self, progress: Callable[[str], None]) -> Recovery:
        """Writes the directory. Raises OSError."""
        self._describe()
        path = self._target / f"{self._target.name}_0.mcap"
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
            self._beside.write_to(self._target, self._done.is_complete)
            finish_bag(writer, file.fileno(), active, path, topics, self._about)
        done = self._done
        done.messages = sum(writer.counts)
        progress("reading what was written")
        try:
            run = open_run(self._target)
            done.steps = self._beside.write_summary(run, done.messages)
        except BadInput as error:
            done.notes.append(f"it has no steps that can be read: {error}")
        return done

    # What is known before anything is written

    def _describe(self) -> None:
        done = self._done
        several = len(self._surveys) > 1
        expected = _expected(self._files) if not several else {}
        for survey in self._surveys:
            name = survey.path.name
            done.notes += [f"{name}: {note}" for note in survey.notes]
            if survey.unchecked:
                done.notes.append(
                    f"{name}: {survey.unchecked} chunks or messages have no CRC: they are taken as they are"
                )
            done.losses += [(name, loss) for loss in survey.losses]
            done.attachments_lost += [loss.attachment for loss in survey.losses if loss.attachment]
            done.chunks_lost += survey.chunks_lost
            done.messages_lost = dict(Counter(done.messages_lost) + Counter(survey.lost(expected)))
            if not survey.has_end:
                done.cut_off.append(name)
            places: dict[int, int] = {}
            for channel, topic in survey.topics.items():
                if topic not in self._topics:
                    self._topics.append(topic)
                places[channel] = self._topics.index(topic)
            self._places.append(places)

    # What is written

    def _write_contents(self, writer: McapWriter, progress: Callable[[str], None]) -> None:
        attachments, about = self._in_front()
        restored = self._beside.attachments(attachments)
        done = self._done
        for attachment in restored:
            if attachment.name in done.attachments_lost:
                done.attachments_lost.remove(attachment.name)
                done.losses = [entry for entry in done.losses if entry[1].attachment != attachment.name]
                done.notes.append(f"attachment {attachment.name} was damaged; it is taken from the run directory")
        self._about = self._beside.about(about, done.notes)
        if self._about:
            writer.add_metadata(RUN_RECORD, self._about)
        writer.add_metadata(RECOVERY_RECORD, self._story())
        for attachment in restored:
            writer.add_attachment(attachment.name, attachment.media_type, attachment.data)
        written = 0
        for survey, places in zip(self._surveys, self._places, strict=True):
            gap: Loss | None = None
            for content in survey.contents():
                if isinstance(content, SoundMessage):
                    if gap is not None:
                        writer.add_metadata(GAP_RECORD, _words_of(gap))
                        gap = None
                    writer.add_message(
                        places[content.channel],
                        content.data,
                        content.log_time_ns,
                        content.publish_time_ns,
                        content.sequence,
                    )
                    written += 1
                    if written % 4096 == 0:
                        progress(f"{written} messages written")
                elif isinstance(content, Attachment):
                    writer.add_attachment(
                        content.name, content.media_type, content.data, content.log_time, content.create_time
                    )
                elif isinstance(content, Loss):
                    gap = content if content.is_gap else gap
                elif content.name not in (BAG_RECORD, RUN_RECORD, RECOVERY_RECORD):
                    writer.add_metadata(content.name, content.metadata)
            if survey is not self._surveys[-1] and not survey.has_end:
                writer.add_metadata(GAP_RECORD, {"why": f"{survey.path.name} was cut off"})
        writer.flush()

    def _in_front(self) -> tuple[dict[str, Attachment], dict[str, str]]:
        """The attachments, by name, and what the recording says about its run."""
        attachments: dict[str, Attachment] = {}
        about: dict[str, str] = {}
        for survey in self._surveys:
            for record in survey.records():
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
            "from": " ".join(str(survey.path.name) for survey in self._surveys),
            COMPLETE: str(done.is_complete).lower(),
            LOST: done.lost_words,
            "chunks_lost": str(done.chunks_lost),
            "messages_lost": str(sum(done.messages_lost.values())),
        }


def _all_of(write: Callable[[Any], int | None]) -> Callable[[bytes], None]:
    """Writes all of it: a file without a buffer may write less."""

    def write_all(data: bytes) -> None:
        rest = memoryview(data)
        while rest:
            rest = rest[write(rest) or 0 :]

    return write_all


def _channel(topic: Topic) -> WriterChannel:
    return WriterChannel(
        topic.name, topic.type_name, topic.schema, topic.metadata, topic.message_encoding, topic.schema_encoding
    )


def _words_of(loss: Loss) -> dict[str, str]:
    times = {"start_ns": loss.start_ns, "end_ns": loss.end_ns}
    return {"why": loss.why, **{name: str(value) for name, value in times.items() if value is not None}}


def _expected(files: RunFiles) -> dict[str, int]:
    """How many messages of each topic metadata.yaml tells of; it was written when the recording was whole."""
    expected: dict[str, int] = {}
    for entry in files.information.get("topics_with_message_count") or []:
        with suppress(TypeError, KeyError):
            name, count = entry["topic_metadata"]["name"], entry["message_count"]
            if isinstance(name, str) and isinstance(count, int):
                expected[name] = count
    return expected
