"""Write the report of a recorded run: one page for exploring it, and optionally figures and tables."""

import os
import sys

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))  # noqa: PTH100, PTH120 - Python 2 gets as far as here

from environment import enter

if __name__ == "__main__":
    # matplotlib and pyarrow, which only figures and tables need, are among what studies need.
    enter("report", purpose="study" if "--figures" in sys.argv[1:] else "run")
