"""The files that a mux that learns writes: the run directory, and the recording of its decisions and commands."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from time import monotonic

from fbql_common.core.errors import BadInput
from fbql_common.core.mux_types import MuxDecision
from fbql_common.core.recording_names import CONFIG, POLICY_BEFORE
from fbql_common.core.topic_names import DECISION, MUX_OUTPUT
from fbql_common.core.twist import StampedTwist, Twist
from fbql_common.files import removed_on_failure
from fbql_common.qos import COMMAND_QOS, STEP_QOS
from fbql_recording.recorder import Attachment, Recorder
from fbql_recording.run_directory import RunDirectory, custom_data, own_revision, software_versions

from fbql_fusion.core.mux.learning import NODE, MuxDescription
from fbql_fusion.core.mux_session import MuxSession
from fbql_fusion.policy_storage import learned_bytes
from fbql_fusion.run_recorder import SessionRecorder, channel_of, directory_of_run

_DECISION, _COMMAND = 0, 1
SAVE_PERIOD_S = 30.0
"""Shortest time between two saves of the policy [s]. A process that is killed loses no more than this."""


class MuxRecorder(SessionRecorder):
    """Writes the results of a session, and records it if that is asked for. No failure here ever affects control.

    Args:
        resolve: a relative topic name -> the absolute one.
        report: called once, with one line, for each thing that could not be stored.

    Raises:
        BadInput: the run directory can't be made or used.
    """

    def __init__(
        self, mux: MuxDescription, session: MuxSession, resolve: Callable[[str], str], report: Callable[[str], None]
    ) -> None:
        super().__init__()
        self._session: MuxSession = session
        self._begun_s = self._saved_s = monotonic()
        self._episodes = 0
        parameters = session.parameters
        self.path, is_new = directory_of_run(mux.learned.run_directory, parameters.controller, parameters.seed)
        with removed_on_failure(self.path) if is_new else nullcontext():
            self._begin(replace(mux, learning=parameters), resolve, report)

    def _begin(self, mux: MuxDescription, resolve: Callable[[str], str], report: Callable[[str], None]) -> None:
        config = {
            "versions": software_versions(),
            "git_revision": own_revision(),
            "parameters": {NODE: mux.values()},
        }
        self._directory = RunDirectory(self.path, config, [], report)
        self._recorder = None
        if not mux.learned.record:
            return
        try:
            attachments = [Attachment(CONFIG, "application/yaml", (self.path / CONFIG).read_bytes())]
            if mux.learned.policy:
                before = Path(mux.learned.policy).read_bytes()
                attachments.append(Attachment(POLICY_BEFORE, "application/octet-stream", before))
            kind = StampedTwist if mux.settings.use_stamped else Twist
            channels = [
                channel_of(resolve(DECISION), MuxDecision, STEP_QOS),
                channel_of(resolve(MUX_OUTPUT), kind, COMMAND_QOS),
            ]
            self._recorder = Recorder(self.path, channels, custom_data(config, NODE), attachments, report)
        except (BadInput, OSError):
            self._directory.discard()
            raise

    def record_decision(self, data: bytes, stamp_ns: int) -> None:
        """Records a decision; adds the row of an episode that it ended, and now and then saves what has been learned by then."""
        if self._recorder is not None:
            self._recorder.write(_DECISION, data, stamp_ns)
        for record in self._session.records[self._episodes :]:
            self._episodes += 1
            self._directory.add_episode(record)
            self.flush()
            if self._session.is_learning and monotonic() - self._saved_s >= SAVE_PERIOD_S:
                self._directory.write_policy(lambda: learned_bytes(self._session))
                self._saved_s = monotonic()

    def record_command(self, data: bytes, stamp_ns: int) -> None:
        """Records a command that was published."""
        if self._recorder is not None:
            self._recorder.write(_COMMAND, data, stamp_ns)
