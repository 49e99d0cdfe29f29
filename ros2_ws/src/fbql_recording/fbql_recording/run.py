"""A recorded run, opened: `open_run(path)`."""

from __future__ import annotations

import csv
import io
from collections.abc import Collection, Iterable, Iterator
from pathlib import Path
from typing import Any

from fbql_common.core.cdr import Malformed
from fbql_common.core.errors import BadInput
from fbql_common.core.plain_json import json_from
from fbql_common.core.recording_names import (
    COMPLETE,
    CONFIG,
    EPISODES,
    GAP_RECORD,
    LOST,
    RECOVERY_RECORD,
    RESTART_RECORD,
    RUN_RECORD,
)

from fbql_recording.bag_agreement import compare, told_by
from fbql_recording.core.columns import Columns, Recorded, columns_of
from fbql_recording.core.decoding import MUX_DECISION, TYPES, MessageCodec
from fbql_recording.core.episodes import Episode, episodes_of
from fbql_recording.core.steps import Key, Step, StepData, StepJoin, key_of
from fbql_recording.mcap.reader import Corrupt, McapFile, Message, Topic, Window
from fbql_recording.plain_yaml import mapping_from_yaml
from fbql_recording.run_files import RunFiles, find_files, read_inside

_WORLD, _OUTPUT = "fbql_msgs/msg/WorldState", "fbql_msgs/msg/BehaviorOutput"
_COMMAND, _DECISION = "fbql_msgs/msg/WheelCommand", "fbql_msgs/msg/FusionDecision"


def open_run(path: Path | str, *, skip_corrupt: bool = False, namespace: str | None = None) -> Run:
    """Opens a recording: a run directory, any directory that `ros2 bag` accepts, or one MCAP file alone.

    Only the description of the run is kept in memory: every iteration reads the file again.

    Args:
        path: the directory or file.
        skip_corrupt: whether damaged parts are left out and counted (`Run.warnings`) instead of raising an exception.
        namespace: that of the wanted graph, if several were recorded together; "/" is none.

    Raises:
        BadInput: there is nothing to read: one line with the file and the reason. `Corrupt`, which is one, is raised
            while reading when a chunk or record is damaged.
    """
    return Run(find_files(Path(path)), skip_corrupt, namespace)


class Run:
    """A recorded run. See `open_run`."""

    def __init__(self, files: RunFiles, skip_corrupt: bool, namespace: str | None) -> None:
        self.directory = files.directory
        """The run directory, or None for an MCAP file alone."""
        self.files = tuple(files.recordings)
        """The MCAP files, in order."""
        self._warnings = list(files.warnings)
        self._skip_corrupt = skip_corrupt
        self._mcaps: list[McapFile] = []
        self.topics: dict[str, Topic] = {}
        """Every recorded topic, by name."""
        for path in self.files:
            self._mcaps.append(McapFile(path, skip_corrupt, self.topics))
            for topic in self._mcaps[-1].topics.values():
                self.topics.setdefault(topic.name, topic)
        self._is_short = self._check_metadata(files.information)
        self.attachments: dict[str, bytes] = {}
        """Files inside the recording (config.yaml, trees/NAME.json, policy_before.npz, policy.npz), by name."""
        for mcap in self._mcaps:
            self.attachments |= mcap.attachments
        self._left_out: dict[str, int] = {}
        self._repeated = 0
        self._places = _Places(self.topics, namespace, str(self.files[0]))
        self._warnings += self._places.left_out
        self.config: dict[str, Any] = self._config()
        """config.yaml: versions, git_revision, parameters of each node. Empty where the recording has none."""
        self.behaviors = self._behaviors()
        """Names of the behaviors, in the order in which they are fused."""

    # What the run was

    @property
    def path(self) -> Path:
        """The run directory, or the MCAP file alone."""
        return self.directory or self.files[0]

    @property
    def counts(self) -> dict[str, int]:
        """Number of recorded messages by topic."""
        return {name: sum(mcap.counts.get(name, 0) for mcap in self._mcaps) for name in self.topics}

    @property
    def start_ns(self) -> int | None:
        """Smallest log time [ns]; None without messages."""
        return min((mcap.start_ns for mcap in self._mcaps if mcap.start_ns is not None), default=None)

    @property
    def end_ns(self) -> int | None:
        """Largest log time [ns]; None without messages."""
        return max((mcap.end_ns for mcap in self._mcaps if mcap.end_ns is not None), default=None)

    @property
    def parameters(self) -> dict[str, dict[str, Any]]:
        """Parameters in force, by node; empty where the recording has none."""
        return self.config.get("parameters", {})

    @property
    def about(self) -> dict[str, str]:
        """The recording's description of itself: the controller and seed of a match, the behavior of demonstrations."""
        records = [values for mcap in self._mcaps for name, values in mcap.metadata.values() if name == RUN_RECORD]
        return dict(records[0]) if records else {}

    @property
    def summary(self) -> dict[str, Any] | None:
        """summary.json of the run directory; None without one."""
        data = None if self.directory is None else read_inside(self.directory, "summary.json")
        if data is None:
            return None
        try:
            found = json_from(data)
        except BadInput as error:
            raise BadInput(f"{self.directory}/summary.json: {error}") from None
        if not isinstance(found, dict):
            raise BadInput(f"{self.directory}/summary.json: not a JSON object")
        return found

    @property
    def is_of_mux(self) -> bool:
        """Whether it is of a mux of velocity commands, and not of a match."""
        return any(topic.type_name == MUX_DECISION for topic in self.topics.values())

    def require_match(self) -> None:
        """Raises BadInput for a run of a mux, which has no field, ball or wheels."""
        if self.is_of_mux:
            raise BadInput(
                f"{self.path}: a run of a mux, not of a match; replay can verify and publish it, report shows it"
            )

    # What is wrong with it

    @property
    def is_complete(self) -> bool:
        """Whether everything that was recorded is there. Damage found later, while reading, counts from then on."""
        is_damaged = any(mcap.damage.any for mcap in self._mcaps) or self._is_short
        return not is_damaged and not self._left_out and not self._lost_before()

    @property
    def warnings(self) -> list[str]:
        """Problems of the recording, one line each, with counts; more may be added while it is read."""
        lines = list(self._warnings)
        lines += [f"{self.path}: recovered; lost: {what}" for what in self._lost_before()]
        for mcap in self._mcaps:
            damage = mcap.damage
            if damage.cut_off_at is not None:
                count = sum(mcap.counts.values())
                lines.append(
                    f"{mcap.path}: cut off at byte {damage.cut_off_at} of {mcap.size}; "
                    f"the complete part, {count} messages, is used"
                )
            lines += [f"{mcap.path}: left out: {what}" for what in (*mcap.left_out.values(), *damage.chunks.values())]
            lines += [f"{mcap.path}: left out at byte {at}: {what}" for at, what in damage.other.items()]
        lines += [f"{self.path}: left out {count} messages of {topic}" for topic, count in self._left_out.items()]
        return lines

    # What is in it

    def messages(
        self, topics: Collection[str] | None = None, start_ns: int | None = None, end_ns: int | None = None
    ) -> Iterator[Message]:
        """The messages as they were recorded, in the file's order.

        Args:
            topics: names of the topics that are wanted; all unless given.
            start_ns: log times from here on [ns].
            end_ns: log times before this [ns].

        Raises:
            Corrupt: damage, unless it is skipped.
        """
        window = Window(topics, start_ns, end_ns)
        for mcap in self._mcaps:
            yield from mcap.messages(window)

    def step_data(self) -> Iterator[StepData]:
        """The steps as recorded bytes, joined by stamp, episode and step. Raises Corrupt."""
        places = self._places.of(self.behaviors)
        join = StepJoin(len(self.behaviors) + 3)
        marks: list[str] = []

        def mark(name: str, _values: dict[str, str]) -> None:
            if name in (RESTART_RECORD, GAP_RECORD):
                marks.append(name)

        add, ready = join.add, join.ready
        for mcap in self._mcaps:
            for message in mcap.messages(Window(tuple(places)), mark):
                if marks:
                    yield from join.rest()
                    join.mark_next(begins_again=RESTART_RECORD in marks, after_gap=GAP_RECORD in marks)
                    marks.clear()
                place, codec = places[message.topic]
                key = key_of(message.data) if codec.is_ours else None
                if key is None:
                    key = self._key(message, codec)
                    if key is None:
                        continue
                add(place, key, message.data)
                yield from ready()
        yield from join.rest()
        self._repeated = join.repeated

    def steps(self) -> Iterator[Step]:
        """The steps, decoded. Raises Corrupt."""
        codecs = self._places.codecs
        output = codecs.get(_OUTPUT)
        n = len(self.behaviors)
        for data in self.step_data():
            parts = data.data
            yield Step(
                data.stamp_ns,
                data.episode,
                data.step,
                self._decoded(codecs.get(_WORLD), parts[0]),
                tuple([self._decoded(output, part) for part in parts[1 : n + 1]]),
                self._decoded(codecs.get(_COMMAND), parts[n + 1]),
                self._decoded(codecs.get(_DECISION), parts[n + 2]),
                data.begins_again,
                data.after_gap,
            )

    def episodes(self, steps: Iterable[Step] | None = None) -> list[Episode]:
        """The episodes. Raises Corrupt.

        Args:
            steps: those of `steps()`, if the caller has them; otherwise they are read here.
        """
        episodes = list(episodes_of(self.steps() if steps is None else steps))
        seeds = self._seeds()
        for episode in episodes:
            episode.seed = seeds.get(episode.index)
        return episodes

    def arrays(self) -> Columns:
        """The steps as NumPy arrays, one row per step; `fbql_recording.core.columns.block_of` lists them. Raises
        Corrupt."""
        return columns_of(self.steps(), self.recorded)

    @property
    def recorded(self) -> Recorded:
        """Which kinds of messages the recording has."""
        there = {topic.type_name for topic in self._places.topics}
        return Recorded(_WORLD in there, self.behaviors, _OUTPUT in there, _COMMAND in there, _DECISION in there)

    @property
    def repeated(self) -> int:
        """Number of messages left out when `steps` was last read to its end: duplicates of a kind within a step."""
        return self._repeated

    def codec(self, type_name: str) -> MessageCodec[Any] | None:
        """The codec of a message type by the recorded schema; None if no topic has that type."""
        return self._places.codecs.get(type_name)

    def _decoded(self, codec: MessageCodec[Any] | None, data: bytes) -> Any:
        if not data or codec is None:
            return None
        try:
            return codec.decode(data)
        except Malformed as error:
            return self._leave_out(codec.kind.__name__, str(error))

    def _key(self, message: Message, codec: MessageCodec[Any]) -> Key | None:
        try:
            decoded = codec.decode(message.data)
        except Malformed as error:
            return self._leave_out(
                message.topic, f"message {message.sequence} at {message.log_time_ns / 1e9:.3f} s: {error}"
            )
        return decoded.stamp_ns, decoded.episode, decoded.step

    def _leave_out(self, what: str, why: str) -> None:
        if not self._skip_corrupt:
            raise Corrupt(f"{self.path}: {what}: {why}; skip_corrupt (--skip-corrupt) reads the rest")
        self._left_out[what] = self._left_out.get(what, 0) + 1

    def _check_metadata(self, information: dict[str, Any]) -> bool:
        """Warns where metadata.yaml and its files disagree. Returns whether the files hold less than it says."""
        if not information or any(mcap.damage.any or not mcap.is_whole for mcap in self._mcaps):
            return False  # of a damaged file it is known what is missing
        agreement = compare(told_by(information), self._mcaps, self.topics)
        self._warnings += [f"{self.directory}/metadata.yaml: {each}" for each in agreement.differences]
        return agreement.is_short

    def _lost_before(self) -> list[str]:
        """What was lost before the recording was recovered, in words; empty for one that was never damaged."""
        records = [values for mcap in self._mcaps for name, values in mcap.metadata.values() if name == RECOVERY_RECORD]
        return [values.get(LOST, "something") for values in records if values.get(COMPLETE) != "true"]

    # What describes it

    def _behaviors(self) -> tuple[str, ...]:
        """The behaviors by the parameters, which a CRC covers; else by the recording's description; else by its first
        decision; else by the topics in their order."""
        there = tuple(self._places.behaviors)
        told = self.parameters.get("fusion", {}).get("behaviors")
        if isinstance(told, list) and told and all(isinstance(name, str) for name in told):
            return tuple(told)
        for mcap in self._mcaps:
            for name, values in mcap.metadata.values():
                if name == RUN_RECORD and values.get("behaviors"):
                    return tuple(values["behaviors"].split(" "))
        decisions = [topic.name for topic in self._places.topics if topic.type_name == _DECISION]
        codec = self._places.codecs.get(_DECISION)
        if decisions and codec is not None:
            for message in self.messages(decisions):
                decision = self._decoded(codec, message.data)
                if decision is not None:
                    return decision.behaviors
        return there

    def _config(self) -> dict[str, Any]:
        data = self.attachments.get(CONFIG)
        if data is None and self.directory is not None:
            data = read_inside(self.directory, "config.yaml")
        where = f"{self.path}: config.yaml"
        config = {} if data is None else mapping_from_yaml(data, where)
        nodes = config.get("parameters", {})
        if not isinstance(nodes, dict) or not all(isinstance(values, dict) for values in nodes.values()):
            raise BadInput(f"{where}: 'parameters' is not a mapping of nodes to their parameters")
        if not isinstance(config.get("versions", {}), dict):
            raise BadInput(f"{where}: 'versions' is not a mapping of packages to versions")
        return config

    def _seeds(self) -> dict[int, int]:
        """Seed of each episode, from episodes.csv in the recording, else in the directory."""
        data = self.attachments.get(EPISODES)
        if data is None and self.directory is not None:
            data = read_inside(self.directory, "episodes.csv")
        try:
            rows = csv.DictReader(io.StringIO((data or b"").decode()))
            return {int(row["index"]): int(row["seed"]) for row in rows}
        except (ValueError, KeyError, TypeError, csv.Error) as error:
            raise BadInput(f"{self.path}: episodes.csv has no such rows ({error!r})") from None


class _Places:
    """Which topics hold the messages of a step, and how they are decoded."""

    def __init__(self, topics: dict[str, Topic], namespace: str | None, where: str) -> None:
        ours = [topic for topic in topics.values() if topic.type_name in TYPES and _is_in(topic.name, namespace)]
        self.topics = [topic for topic in ours if topic.kind[1:] == ("cdr", "ros2msg")]
        self.left_out = [
            f"{where}: left out: topic {topic.name} is recorded as '{topic.message_encoding}' by a "
            f"'{topic.schema_encoding}' schema; only cdr by ros2msg is read"
            for topic in ours
            if topic not in self.topics
        ]
        """Our own topics that can't be read, in words."""
        self.behaviors: dict[str, str] = {}
        """Topic of each behavior that was recorded, by the behavior's name."""
        self._single: dict[str, str] = {}
        self.codecs: dict[str, MessageCodec[Any]] = {}
        for topic in self.topics:
            if topic.type_name == _OUTPUT:
                name = topic.name.rpartition("/")[2]
                clash = self.behaviors.setdefault(name, topic.name)
            else:
                clash = self._single.setdefault(topic.type_name, topic.name)
            if clash != topic.name:
                raise BadInput(f"{where}: both {clash} and {topic.name} are {topic.type_name}; choose a namespace")
            if topic.type_name not in self.codecs:
                try:
                    self.codecs[topic.type_name] = MessageCodec(topic.type_name, topic.schema)
                except BadInput as error:
                    raise BadInput(f"{where}: {topic.name}: {error}") from None

    def of(self, behaviors: tuple[str, ...]) -> dict[str, tuple[int, MessageCodec[Any]]]:
        """By topic: the index in `StepData.data`, and its codec."""
        after = len(behaviors) + 1
        places = {self.behaviors[name]: index for index, name in enumerate(behaviors, 1) if name in self.behaviors}
        for type_name, place in ((_WORLD, 0), (_COMMAND, after), (_DECISION, after + 1)):
            if type_name in self._single:
                places[self._single[type_name]] = place
        types = {topic.name: topic.type_name for topic in self.topics}
        return {topic: (place, self.codecs[types[topic]]) for topic, place in places.items()}


def _is_in(topic: str, namespace: str | None) -> bool:
    if namespace is None:
        return True
    prefix = namespace.strip("/")
    inside = topic.removeprefix(f"/{prefix}/" if prefix else "/")
    return inside != topic and (inside.count("/") == 0 or inside.startswith(("behaviors/", "fusion/")))
