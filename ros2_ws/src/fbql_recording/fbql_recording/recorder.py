"""The recording of a run: a directory that `ros2 bag` accepts, written while the run is in progress.

<directory>/<directory's name>_0.mcap.active while it is written, .mcap when it is finished, then metadata.yaml.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from fbql_common.core.errors import BadInput
from fbql_common.core.recording_names import BAG_RECORD, RUN_RECORD
from fbql_common.files import remedy, write_atomically

from fbql_recording.bag_metadata import BagTopic, Qos, bag_information, qos_profiles, to_yaml
from fbql_recording.mcap.writer import McapWriter, WriterChannel

CHUNK_BYTES = 256 * 1024
"""Uncompressed size of a chunk: the amount that a crash loses, unless `flush` is called more often."""


class Channel(NamedTuple):
    """One topic that is recorded."""

    topic: str
    """Absolute name."""
    type_name: str
    """pkg/msg/Name"""
    schema_text: str
    """`message_definitions.schema_text`"""
    type_hash: str
    """`message_definitions.type_hash`"""
    qos: Qos


class Attachment(NamedTuple):
    """A file inside the recording."""

    name: str
    media_type: str
    data: bytes


def finish_bag(
    writer: McapWriter,
    fd: int,
    active_path: Path,
    path: Path,
    topics: Sequence[BagTopic],
    custom_data: Mapping[str, str],
) -> None:
    """Finishes a file and makes its directory a bag: the file completed and renamed, then metadata.yaml.

    Args:
        writer: everything but the end of the file is written.
        fd: the file that it writes to.
        active_path: the file's name until now.
        path: its name from now on.
        topics: what is in it.
        custom_data: about the run.

    Raises:
        OSError: it could not be written; it keeps the name it had.
    """
    distribution = os.environ.get("ROS_DISTRO", "jazzy")
    information = bag_information(path.name, topics, writer.start_ns, writer.end_ns, custom_data, distribution)
    writer.add_metadata(BAG_RECORD, {"serialized_metadata": to_yaml(information)})
    writer.finish()
    # Some file systems find out only here that the disk is full.
    os.fsync(fd)
    active_path.rename(path)
    metadata = to_yaml({"rosbag2_bagfile_information": information})
    try:
        write_atomically(path.with_name("metadata.yaml"), metadata.encode())
    except OSError:
        path.rename(active_path)
        raise


class Recorder:
    """Records serialized messages. A disk failure stops the recording for good, and nothing else.

    After the first OSError it has `failed`: the data on disk stays, cut to its last complete record, as .mcap.active;
    everything that follows is ignored. Not for use by two threads at once.

    Args:
        directory: an existing directory without a recording.
        channels: the topics; a channel's index here is its index in `write`.
        custom_data: about the run (seed, parameters, revision); in the file from the start.
        attachments: files of the run (trees, policy, configuration); in the file from the start.
        report: called once, with one line, when the recording fails.

    Raises:
        BadInput: the directory can't be written to, or holds a recording.
    """

    def __init__(
        self,
        directory: Path,
        channels: Sequence[Channel],
        custom_data: Mapping[str, str],
        attachments: Sequence[Attachment],
        report: Callable[[str], None],
    ) -> None:
        self.path = directory / f"{directory.name}_0.mcap"
        """The finished file."""
        self.active_path = self.path.with_name(self.path.name + ".active")
        """The file while it is written."""
        self.failure: OSError | None = None
        """Why something could not be recorded."""
        self._channels = tuple(channels)
        self._custom_data = dict(custom_data)
        self._report = report
        self._closed = False
        self._size = 0
        for path in (self.path, directory / "metadata.yaml"):
            if path.exists():
                raise BadInput(f"{path} exists; a recording is never overwritten, choose another directory")
        try:
            self._fd = os.open(self.active_path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o644)
        except OSError as error:
            raise BadInput(f"{self.active_path}: can't record there ({error.strerror}); {remedy(error)}") from None
        try:
            self._writer = McapWriter(
                self._put,
                [
                    WriterChannel(
                        channel.topic,
                        channel.type_name,
                        channel.schema_text,
                        {
                            "offered_qos_profiles": to_yaml(qos_profiles(channel.qos)),
                            "topic_type_hash": channel.type_hash,
                        },
                    )
                    for channel in self._channels
                ],
                CHUNK_BYTES,
            )
            if self._custom_data:
                self._writer.add_metadata(RUN_RECORD, self._custom_data)
            self._attach(attachments)
        except OSError as error:
            os.close(self._fd)
            self.active_path.unlink(missing_ok=True)
            raise BadInput(f"{self.active_path}: can't record there ({error.strerror}); {remedy(error)}") from None

    @property
    def failed(self) -> bool:
        """Whether something could not be recorded."""
        return self.failure is not None

    @property
    def messages(self) -> int:
        """Number of recorded messages; after a failure, of those on disk."""
        return sum(self._writer.counts) + (0 if self.failed else self._writer.waiting)

    def write(self, channel: int, data: bytes, log_time_ns: int) -> None:
        """Records one message.

        Args:
            channel: index into the channels.
            data: CDR with its encapsulation header.
            log_time_ns: time of the message [ns], 0 .. 2^64 - 1; it is the publish time too.

        Raises:
            ValueError: log_time_ns is out of that range.
        """
        if self._closed or self.failed:
            return
        if not 0 <= log_time_ns < 1 << 64:
            raise ValueError(f"log_time_ns is {log_time_ns}; MCAP has times from 0 to 2^64 - 1")
        try:
            self._writer.add_message(channel, data, log_time_ns)
        except OSError as error:
            self._fail(error)

    def note(self, name: str, values: Mapping[str, str]) -> None:
        """Records a Metadata record at this place between the messages, for information that no message holds."""
        if self._closed or self.failed:
            return
        try:
            self._writer.add_metadata(name, values)
        except OSError as error:
            self._fail(error)

    def flush(self) -> None:
        """Passes everything to the operating system: a process killed now loses nothing."""
        if self._closed or self.failed:
            return
        try:
            self._writer.flush()
        except OSError as error:
            self._fail(error)

    def close(self, attachments: Sequence[Attachment] = ()) -> None:
        """Finishes the recording: the file completed and renamed, then metadata.yaml. Further calls do nothing.

        Args:
            attachments: files that only exist at the end (learned policy, summary).
        """
        if self._closed:
            return
        self._closed = True
        try:
            if not self.failed:
                self._finish(attachments)
        except OSError as error:
            self._fail(error)
        finally:
            os.close(self._fd)

    def _finish(self, attachments: Sequence[Attachment]) -> None:
        self._writer.flush()
        self._attach(attachments)
        topics = [
            BagTopic(channel.topic, channel.type_name, channel.type_hash, qos_profiles(channel.qos), count)
            for channel, count in zip(self._channels, self._writer.counts, strict=True)
        ]
        finish_bag(self._writer, self._fd, self.active_path, self.path, topics, self._custom_data)

    def _attach(self, attachments: Sequence[Attachment]) -> None:
        for attachment in attachments:
            self._writer.add_attachment(*attachment)

    def _put(self, data: bytes) -> None:
        rest = memoryview(data)
        while rest:
            rest = rest[os.write(self._fd, rest) :]
        self._size += len(data)

    def _fail(self, error: OSError) -> None:
        """Latches the failure, and cuts off the part of a record that may have been written."""
        self.failure = error
        # Where even that fails a torn record stays at the end, which is what recovery is made for.
        with suppress(OSError):
            os.ftruncate(self._fd, self._size)
        self._report(f"recording FAILED, the run continues without it: {self.path.parent}: {error.strerror}")
