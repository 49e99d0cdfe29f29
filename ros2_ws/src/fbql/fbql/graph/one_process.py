"""The whole graph in one process: the same nodes, one executor. `python one_process.py BEHAVIOR... --ros-args ...`"""

from __future__ import annotations

import sys
from functools import partial

from fbql_behaviors.behavior_node import BehaviorNode
from fbql_common.spin import spin
from fbql_fusion.fusion_node import FusionNode
from fbql_sim.simulator_node import SimulatorNode


def main(argv: list[str]) -> int:
    """Runs the simulator, the named behaviors and fusion until fusion is done. Returns the exit code."""
    split = argv.index("--ros-args") if "--ros-args" in argv else len(argv)
    behaviors = [partial(BehaviorNode, name) for name in argv[:split]]
    return spin([SimulatorNode, *behaviors, FusionNode], [sys.argv[0], *argv[split:]])


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
