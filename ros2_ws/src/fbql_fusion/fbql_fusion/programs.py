"""The executable of this package. It imports no ROS before `start` has looked at the environment."""

from fbql_common.start import start


def fusion() -> int:
    """Runs the fusion node."""
    return start("fbql_fusion.fusion_node", "main")
