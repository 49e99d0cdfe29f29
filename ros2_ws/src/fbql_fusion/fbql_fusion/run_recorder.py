"""The files that the fusion node writes: the recording and the run directory of one session."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import asdict
from datetime import datetime
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Any

from ament_index_python.packages import get_package_share_directory
from fbql_common.core.errors import BadInput
from fbql_common.core.recording_names import (
    CONFIG,
    CONTROLLERS,
    EPISODES,
    OBSERVATIONS,
    POLICY,
    POLICY_BEFORE,
    RESTART_RECORD,
    TREES,
)
from fbql_common.core.topic_names import DECISION, WHEEL_COMMAND, WORLD, behavior_topic
from fbql_common.core.types import BehaviorOutput, Decision, WheelCommand, World
from fbql_common.files import read_file, remedy, removed_on_failure
from fbql_common.own_code import split_source
from fbql_common.qos import STEP_QOS
from fbql_common.wire import type_name
from fbql_recording.bag_metadata import qos_of
from fbql_recording.message_definitions import schema_text, type_hash
from fbql_recording.plain_yaml import mapping_from_yaml
from fbql_recording.recorder import Attachment, Channel, Recorder
from fbql_recording.run_directory import (
    RunDirectory,
    create_next_run_directory,
    create_run_directory,
    custom_data,
    own_revision,
    software_versions,
)
from fbql_recording.run_files import MAX_TEXT_BYTES
from rclpy.qos import QoSProfile

from fbql_fusion.core.soccer_session import SoccerSession
from fbql_fusion.node_parameters import FusionNodeParameters
from fbql_fusion.policy_storage import learned_bytes, save_policy

if TYPE_CHECKING:  # which the fusion node need not load
    from fbql_fusion.core.mux_session import MuxSession

DONE, INCOMPLETE = 0, 3
_JSON, _YAML, _NPZ = "application/json", "application/yaml", "application/octet-stream"
_CSV, _PYTHON = "text/csv", "text/x-python"


class SessionRecorder:
    """Writes the files of a session's run, whatever the task: the run directory, and the recording if it is asked for.
    No failure here ever affects control."""

    _session: SoccerSession | MuxSession
    _directory: RunDirectory
    _recorder: Recorder | None
    path: Path
    """The run directory."""

    def __init__(self) -> None:
        self._closed = False
        self._begun_s: float | None = None

    def flush(self) -> None:
        """Passes the recording so far to the operating system."""
        if self._recorder is not None:
            self._recorder.flush()

    def close(self) -> None:
        """Finishes policy, recording and summary, in this order. Further calls do nothing."""
        if self._closed:
            return
        self._closed = True
        wall_s = None if self._begun_s is None else monotonic() - self._begun_s
        attachments: list[Attachment] = []
        learned = self._directory.write_policy(lambda: learned_bytes(self._session))
        if learned is not None and not self._directory.failed:
            attachments.append(Attachment(POLICY, _NPZ, learned))
        messages = 0
        if self._recorder is not None:
            if not self._directory.failed:
                attachments.append(Attachment(EPISODES, _CSV, (self.path / EPISODES).read_bytes()))
            self._recorder.close(attachments)
            messages = self._recorder.messages
        unseen = self._session.unseen
        more = {"steps_unseen": unseen} if unseen else {}
        self._directory.write_summary(self._session.summary(wall_s, messages, self.incomplete), more)
        self._directory.close()

    @property
    def incomplete(self) -> bool:
        """Whether something that should have been stored was not."""
        return self._directory.failed or (self._recorder is not None and self._recorder.failed)

    def exit_code(self) -> int:
        """0, or 3 when the recording is incomplete."""
        return INCOMPLETE if self.incomplete else DONE


class RunRecorder(SessionRecorder):
    """Records every step of a session and writes its results. No failure here ever affects control.

    Args:
        resolve: a relative topic name -> the absolute one.
        report: called once, with one line, for each thing that could not be stored.

    Raises:
        BadInput: the run directory can't be made or used.
    """

    def __init__(
        self,
        parameters: FusionNodeParameters,
        session: SoccerSession,
        resolve: Callable[[str], str],
        report: Callable[[str], None],
    ) -> None:
        super().__init__()
        self._session: SoccerSession = session
        fusion = session.parameters
        self.path, is_new = directory_of_run(parameters.run_directory, fusion.controller, fusion.seed)
        with removed_on_failure(self.path) if is_new else nullcontext():
            self._begin(parameters, resolve, report)

    def _begin(
        self, parameters: FusionNodeParameters, resolve: Callable[[str], str], report: Callable[[str], None]
    ) -> None:
        session = self._session
        tree_files = [Path(file) for file in parameters.tree_files]
        config = _config(parameters, session, parameters.config_file)
        self._directory = RunDirectory(self.path, config, tree_files, report)
        self._recorder = None
        if not parameters.record:
            return
        try:
            attachments = [Attachment(CONFIG, _YAML, (self.path / "config.yaml").read_bytes())]
            attachments += [Attachment(f"{TREES}{file.name}", _JSON, file.read_bytes()) for file in tree_files]
            attachments += _own_code(config)
            if parameters.policy:
                attachments.append(Attachment(POLICY_BEFORE, _NPZ, Path(parameters.policy).read_bytes()))
            self._recorder = Recorder(
                self.path, _channels(session.behaviors, resolve), custom_data(config), attachments, report
            )
        except (BadInput, OSError):
            self._directory.discard()
            raise

    def record(self, stamp_ns: int, world: bytes, outputs: Sequence[bytes], command: bytes, decision: bytes) -> None:
        """Records the messages of one step, always in the same order."""
        if self._begun_s is None:
            self._begun_s = monotonic()
        recorder = self._recorder
        if recorder is None:
            return
        write = recorder.write
        write(0, world, stamp_ns)
        for channel, output in enumerate(outputs, start=1):
            if output:
                write(channel, output, stamp_ns)
        write(len(outputs) + 1, command, stamp_ns)
        write(len(outputs) + 2, decision, stamp_ns)

    def episode_ended(self) -> None:
        """Adds the row of the episode that just ended, and passes the recording so far to the operating system."""
        self._directory.add_episode(self._session.records[-1])
        self.flush()

    def episode_restarted(self) -> None:
        """Records that the current episode restarts with the next step because its world was lost."""
        if self._recorder is not None:
            self._recorder.note(RESTART_RECORD, {})

    def save_policy(self, path: Path | None) -> str:
        """Saves what has been learned so far; returns the path.

        Raises:
            BadInput: nothing is learned, or a value is not finite.
            OSError: it could not be written.
        """
        policy = self._session.policy()
        if policy is None:
            raise BadInput(f"controller '{self._session.parameters.controller}' has learned nothing to save yet")
        target = path or self.path / "policy.npz"
        save_policy(target, policy)
        return str(target)


def directory_of_run(given: str, controller: str, seed: int) -> tuple[Path, bool]:
    """The run directory that a parameter names, or else a new one in runs/, and whether it was made here. Raises BadInput."""
    if given:
        path = Path(given).absolute()
        is_new = not path.exists()
        if is_new:
            create_run_directory(path)
        return path, is_new
    runs = Path.cwd() / "runs"
    try:
        runs.mkdir(exist_ok=True)
    except OSError as error:
        raise BadInput(
            f"{runs}: can't be created ({error.strerror}); {remedy(error)}: parameter run_directory"
        ) from None
    return create_next_run_directory(runs, f"{datetime.now():%Y%m%d-%H%M%S}-{controller}-s{seed}"), True


def _config(parameters: FusionNodeParameters, session: SoccerSession, launcher_file: str) -> dict[str, Any]:
    """Every parameter in force. A launcher, which also knows the other nodes' parameters, passes them on in its
    parameter file."""
    nodes = launcher_parameters(Path(launcher_file)) if launcher_file else {}
    nodes["fusion"] = {**asdict(session.parameters), **asdict(parameters)}
    return {
        "versions": software_versions(),
        "git_revision": own_revision(),
        "parameters": nodes,
    }


def launcher_parameters(path: Path) -> dict[str, Any]:
    """The parameters of every node of the graph, by node, from the parameter file of a launcher. Raises BadInput."""
    document = mapping_from_yaml(read_file(path, MAX_TEXT_BYTES), str(path))
    try:
        return {name.lstrip("/"): {**section["ros__parameters"]} for name, section in document.items()}
    except (KeyError, TypeError):
        raise BadInput(f"{path}: not the parameters of nodes (NAME: ros__parameters: ...)") from None


def _own_code(config: Mapping[str, Any]) -> list[Attachment]:
    """The user's own Python files, which the launcher names as FILE.py:NAME: of the controller and of observations."""
    nodes = config["parameters"]
    sources = {
        f"{OBSERVATIONS}{name}.py": values["observation"]
        for name, values in nodes.items()
        if name != "fusion" and values.get("observation")
    }
    if source := nodes["fusion"]["controller_file"]:
        sources[f"{CONTROLLERS}{nodes['fusion']['controller']}.py"] = source
    try:
        return [Attachment(name, _PYTHON, split_source(source)[0].read_bytes()) for name, source in sources.items()]
    except OSError as error:
        raise BadInput(f"{error.filename}: can't be recorded ({error.strerror})") from None


def _channels(behaviors: Sequence[str], resolve: Callable[[str], str]) -> list[Channel]:
    topics = [(WORLD, World), *((behavior_topic(name), BehaviorOutput) for name in behaviors)]
    topics += [(WHEEL_COMMAND, WheelCommand), (DECISION, Decision)]
    return [channel_of(resolve(topic), kind, STEP_QOS) for topic, kind in topics]


def channel_of(topic: str, kind: type[Any], qos: QoSProfile) -> Channel:
    """How a topic of this domain type is recorded."""

    def share(package: str) -> Path:
        return Path(get_package_share_directory(package))

    name = type_name(kind)
    return Channel(topic, name, schema_text(name, share), type_hash(name, share), qos_of(qos))
