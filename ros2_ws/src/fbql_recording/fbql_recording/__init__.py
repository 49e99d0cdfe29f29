"""Recorded runs: write (`Recorder`), read (`open_run`) and recover (`recover`) them. Needs no ROS."""

from fbql_recording.core.columns import Columns
from fbql_recording.core.episodes import Episode
from fbql_recording.core.steps import Step
from fbql_recording.mcap.reader import Corrupt, Message, Topic
from fbql_recording.recorder import Attachment, Channel, Recorder
from fbql_recording.recovery.parts import Gap
from fbql_recording.recovery.recover import Recovery, recover
from fbql_recording.run import Run, open_run

__all__ = [
    "Attachment",
    "Channel",
    "Columns",
    "Corrupt",
    "Episode",
    "Gap",
    "Message",
    "Recorder",
    "Recovery",
    "Run",
    "Step",
    "Topic",
    "open_run",
    "recover",
]
