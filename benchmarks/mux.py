"""Measure the latency that the mux adds to velocity commands, and the time of one of its decisions."""

import os
import sys

HERE = os.path.dirname(os.path.abspath(__file__))  # noqa: PTH100, PTH120 - Python 2 gets as far as here
sys.path[:0] = [os.path.join(HERE, os.pardir, "scripts"), HERE]  # noqa: PTH118

from environment import enter  # noqa: E402

if __name__ == "__main__":
    enter("mux", module="measure.mux")
