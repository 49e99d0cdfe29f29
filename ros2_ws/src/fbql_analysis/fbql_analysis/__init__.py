"""Reads recorded runs: `open_run(path)`. Needs no ROS."""

from fbql_analysis.core.columns import Columns
from fbql_analysis.core.episodes import Episode
from fbql_analysis.core.steps import Step
from fbql_analysis.mcap_file import Corrupt, Message, Topic
from fbql_analysis.recording import Run, open_run

__all__ = ["Columns", "Corrupt", "Episode", "Message", "Run", "Step", "Topic", "open_run"]
