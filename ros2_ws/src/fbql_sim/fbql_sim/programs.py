"""The executable of this package. It imports no ROS before `start` has looked at the environment."""

from fbql_common.start import start


def simulator() -> int:
    """Runs the simulator node."""
    return start("fbql_sim.simulator_node", "main")
