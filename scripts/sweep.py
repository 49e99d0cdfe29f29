"""Play controllers and parameters over several values and seeds, and compare them."""

import os
import sys

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))  # noqa: PTH100, PTH120 - Python 2 gets as far as here

from environment import enter

if __name__ == "__main__":
    enter("sweep", purpose="study")
