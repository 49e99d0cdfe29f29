"""Names of topics and services, and their quality of service. Names are relative: a node's namespace applies."""

from __future__ import annotations

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

WORLD = "world"
WHEEL_COMMAND = "wheel_command"
DECISION = "fusion/decision"
ROBOT_POSE = "robot/pose"
BALL_POSE = "ball/pose"
WALL_POSE = "wall/pose"
CLOCK = "/clock"
DIAGNOSTICS = "/diagnostics"
RESET_EPISODE = "simulator/reset_episode"

STEP_QOS = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=10,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.VOLATILE,
)
"""For every message of a step: reliable, because a step waits for each of them."""

POSE_QOS = STEP_QOS
"""For the topics for ROS tools."""


def behavior_topic(name: str) -> str:
    """The topic that behavior `name` answers on."""
    return f"behaviors/{name}"
