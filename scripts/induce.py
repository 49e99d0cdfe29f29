"""Make a behavior's tree from demonstrations."""

import os
import sys

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))  # noqa: PTH100, PTH120 - Python 2 gets as far as here

from environment import enter

if __name__ == "__main__":
    cart = {"cart", "--method=cart"}.intersection(sys.argv[1:])  # scikit-learn does it
    enter("induce", purpose="study" if cart else "run")
