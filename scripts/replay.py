"""Replay a recorded run onto ROS, verify it by recomputing it, or recompute it with other parameters or trees."""

import os
import sys

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))  # noqa: PTH100, PTH120 - Python 2 gets as far as here

from environment import enter

if __name__ == "__main__":
    # matplotlib, which only the figure needs, is among what studies need.
    enter("replay", purpose="study" if any(word.startswith("--fig") for word in sys.argv[1:]) else "run")
