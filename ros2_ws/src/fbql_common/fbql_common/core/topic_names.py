"""Names of topics and services, which need no ROS. Names are relative: a node's namespace applies."""

from __future__ import annotations

WORLD = "world"
WHEEL_COMMAND = "wheel_command"
DECISION = "fusion/decision"
ROBOT_POSE = "robot/pose"
BALL_POSE = "ball/pose"
WALL_POSE = "wall/pose"
CLOCK = "/clock"
DIAGNOSTICS = "/diagnostics"
CMD_VEL = "cmd_vel"
MUX_OUTPUT = "cmd_vel_out"
MUX_DRIVER = "~/driver"
OUTCOME = "outcome"
REWARD = "reward"
RESET_EPISODE = "simulator/reset_episode"


def behavior_topic(name: str) -> str:
    """The topic that behavior `name` answers on."""
    return f"behaviors/{name}"
