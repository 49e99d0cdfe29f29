"""`scripts/bringup.py`: brings up the graph, watches over it, and tells the result: the main job of the project.

Exit codes: 0 the match was played, or ended by a signal that asked for it; 1 it failed, or a signal came so early that
there is no result; 2 bad input, nothing was started and nothing is left behind; 3 the recording is incomplete.
"""

from __future__ import annotations

from collections.abc import Sequence

from launcher.interrupts import Interrupts


def main(argv: Sequence[str]) -> int:
    """Runs the command. Gives the exit code."""
    # Before all else: importing ROS takes a second, in which a signal would end in a traceback.
    interrupts = Interrupts()
    from launcher.bringup_command import run

    return run(argv, interrupts)
