"""Names inside a recording, shared by its writer and its readers."""

from __future__ import annotations

RUN_RECORD = "fbql"
"""Metadata record about the run, at the beginning; the same as custom_data in metadata.yaml."""
BAG_RECORD = "rosbag2"
"""Metadata record that holds metadata.yaml once more, as rosbag2 has it."""
RESTART_RECORD = "fbql_episode_restart"
"""Metadata record before the first step of an episode that restarts because its world was lost."""
RECOVERY_RECORD = "fbql_recovery"
"""Metadata record of a recovered recording: the damaged source, and what is lost."""
GAP_RECORD = "fbql_gap"
"""Metadata record in a recovered recording where messages are missing."""
COMPLETE = "complete"
"""In RECOVERY_RECORD: "true" where nothing is lost."""
LOST = "lost"
"""In RECOVERY_RECORD: what is lost, in words."""

# Attachments
CONFIG = "config.yaml"
EPISODES = "episodes.csv"
POLICY_BEFORE = "policy_before.npz"
POLICY = "policy.npz"
"""The learned policy."""
TREES = "trees/"
"""Prefix of the name of a tree file."""
OBSERVATIONS = "observations/"
"""Prefix of NAME.py: the user's file that defines the observation of behavior NAME."""
