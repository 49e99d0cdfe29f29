"""The executables of this package. They do not import ROS until `start` has checked the environment."""

from fbql_common.start import start


def fusion() -> int:
    """Runs the fusion node."""
    return start("fbql_fusion.fusion_node", "main")


def twist_mux() -> int:
    """Runs the mux node."""
    return start("fbql_fusion.twist_mux_node", "main")
