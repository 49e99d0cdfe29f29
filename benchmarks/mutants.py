"""Make random mutants of the pure cores and see which of them the cores' own tests notice."""

import os
import sys

HERE = os.path.dirname(os.path.abspath(__file__))  # noqa: PTH100, PTH120 - Python 2 gets as far as here
sys.path[:0] = [os.path.join(HERE, os.pardir, "scripts"), HERE]  # noqa: PTH118

from environment import enter  # noqa: E402

if __name__ == "__main__":
    enter("mutants", purpose="test", module="measure.mutants")
