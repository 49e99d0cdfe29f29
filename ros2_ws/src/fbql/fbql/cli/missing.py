"""What to do about a package that a command needs and that is not installed."""

from __future__ import annotations

from fbql_common.checkout import how_to_install

ROS = frozenset(
    {
        *("ament_index_python", "builtin_interfaces", "diagnostic_msgs", "domain_coordinator", "fbql_msgs"),
        *("geometry_msgs", "rcl_interfaces", "rclpy", "rosgraph_msgs", "std_msgs", "visualization_msgs"),
    }
)
EXTRAS = {
    "distributed": "studies",
    "rosbags": "bags",
    "gymnasium": "gymnasium",
    "irsim": "rooms",
    "matplotlib": "studies",
    "pandas": "studies",
    "pyarrow": "studies",
    "sklearn": "studies",
    "stable_baselines3": "peers",
    "foxglove": "foxglove",
}
"""Package -> the extra of the distribution `fbql` that installs it."""


def what_is_missing(module: str) -> str | None:
    """One line about a module that could not be imported; None for one that every installation has."""
    package = module.partition(".")[0]
    if package in ROS:
        return (
            f"this needs ROS 2 Jazzy, whose package {package} can't be imported: source a ROS 2 workspace in which this "
            "project is built, or run python3 scripts/NAME.py in a clone, which installs ROS by itself"
        )
    if package in EXTRAS:
        return f"this needs {package}, which is not installed: {how_to_install(EXTRAS[package])}"
    return None
