"""What things are called inside of a recording: written by the fusion node, looked up by whoever reads it."""

from __future__ import annotations

RUN_RECORD = "fbql"
"""Metadata record about the run, at the beginning; the same as custom_data in metadata.yaml."""
BAG_RECORD = "rosbag2"
"""Metadata record that holds metadata.yaml once more, as rosbag2 has it."""
RESTART_RECORD = "fbql_episode_restart"
"""Metadata record that stands before the first step of an episode that begins again, because its world was lost."""
RECOVERY_RECORD = "fbql_recovery"
"""Metadata record of a recording that was recovered from a damaged one: from which, and what is lost."""
GAP_RECORD = "fbql_gap"
"""Metadata record in a recovered recording where messages are missing between those before and after it."""
COMPLETE = "complete"
"""In RECOVERY_RECORD: "true" where nothing is lost."""
LOST = "lost"
"""In RECOVERY_RECORD: what is lost, in words."""

# Attachments
CONFIG = "config.yaml"
EPISODES = "episodes.csv"
POLICY_BEFORE = "policy_before.npz"
POLICY = "policy.npz"
"""What was learned."""
TREES = "trees/"
"""Before the name of a tree file."""
OBSERVATIONS = "observations/"
"""Before NAME.py: what behavior NAME senses, where the user defined it."""
