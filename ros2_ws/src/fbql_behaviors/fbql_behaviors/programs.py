"""The executables of this package. They do not import ROS until `start` has checked the environment."""

from fbql_common.start import start

_NODE = "fbql_behaviors.behavior_node"


def ball_seeking() -> int:
    """Runs the ball-seeking behavior."""
    return start(_NODE, "ball_seeking")


def wall_avoiding() -> int:
    """Runs the wall-avoiding behavior."""
    return start(_NODE, "wall_avoiding")


def approaching() -> int:
    """Runs the approaching behavior."""
    return start(_NODE, "approaching")


def teleop() -> int:
    """Drives a robot from the keyboard of a terminal."""
    return start("fbql_behaviors.teleop_node", "main")


def behavior() -> int:
    """Runs any tree: `--ros-args -p tree_file:=FILE`."""
    return start(_NODE, "behavior")


def twist_behavior() -> int:
    """Runs a tree made from a bag: `--ros-args -p tree_file:=FILE`."""
    return start("fbql_behaviors.twist_behavior_node", "twist_behavior")
