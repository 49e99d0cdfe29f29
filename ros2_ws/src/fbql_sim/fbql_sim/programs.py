"""The executable of this package. It does not import ROS until `start` has checked the environment."""

from fbql_common.start import start


def simulator() -> int:
    """Runs the simulator node."""
    return start("fbql_sim.simulator_node", "main")
