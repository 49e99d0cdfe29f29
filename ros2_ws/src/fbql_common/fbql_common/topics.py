"""Topics as nodes use them: their names (`core.topic_names`) with the quality of service of each."""

from __future__ import annotations

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSPresetProfiles, QoSProfile, ReliabilityPolicy

from fbql_common.core.topic_names import (
    BALL_POSE,
    CLOCK,
    DECISION,
    DIAGNOSTICS,
    MUX_DRIVER,
    MUX_OUTPUT,
    RESET_EPISODE,
    ROBOT_POSE,
    WALL_POSE,
    WHEEL_COMMAND,
    WORLD,
    behavior_topic,
)

__all__ = [
    "BALL_POSE",
    "CLOCK",
    "COMMAND_QOS",
    "DECISION",
    "DIAGNOSTICS",
    "LATCHED_QOS",
    "MUX_DRIVER",
    "MUX_OUTPUT",
    "POSE_QOS",
    "RESET_EPISODE",
    "ROBOT_POSE",
    "STEP_QOS",
    "SYSTEM_QOS",
    "WALL_POSE",
    "WHEEL_COMMAND",
    "WORLD",
    "behavior_topic",
]

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
"""For a state: whoever comes late gets the last message."""
