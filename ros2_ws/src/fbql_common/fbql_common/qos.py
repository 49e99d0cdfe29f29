"""The quality of service of the topics, whose names are in `core.topic_names`."""

from __future__ import annotations

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSPresetProfiles, QoSProfile, ReliabilityPolicy

STEP_QOS = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=10,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.VOLATILE,
)
"""For every message of a step: reliable, because a step waits for each of them."""

POSE_QOS = STEP_QOS
"""For the topics that are made for ROS tools."""

COMMAND_QOS = QoSProfile(depth=1)
"""For a robot's velocity commands, of which only the newest is of use: reliable, as twist_mux's output is."""

SYSTEM_QOS: QoSProfile = QoSPresetProfiles.SYSTEM_DEFAULT.value
"""The middleware's own defaults, with which twist_mux subscribes to its inputs."""

LATCHED_QOS = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""For a state: late subscribers get the last message."""
