"""Topics as nodes use them: their names (`core.topic_names`) with the quality of service of each."""

from __future__ import annotations

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

from fbql_common.core.topic_names import (
    BALL_POSE,
    CLOCK,
    DECISION,
    DIAGNOSTICS,
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
    "DECISION",
    "DIAGNOSTICS",
    "POSE_QOS",
    "RESET_EPISODE",
    "ROBOT_POSE",
    "STEP_QOS",
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
