"""Reads recorded runs: `open_run(path)`. Needs no ROS."""

from fbql_recording.core.columns import Columns
from fbql_recording.core.episodes import Episode
from fbql_recording.core.steps import Step
from fbql_recording.mcap.reader import Corrupt, Message, Topic
from fbql_recording.run import Run, open_run

__all__ = ["Columns", "Corrupt", "Episode", "Message", "Run", "Step", "Topic", "open_run"]
