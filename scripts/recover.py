"""Repair a damaged recording: keep everything undamaged, and report what is lost."""

import os
import sys

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))  # noqa: PTH100, PTH120 - Python 2 gets as far as here

from environment import enter

if __name__ == "__main__":
    enter("recover")
