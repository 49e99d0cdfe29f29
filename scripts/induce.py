"""Make a behavior's tree from demonstrations."""

import os
import sys

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))  # noqa: PTH100, PTH120 - Python 2 gets as far as here

from environment import enter

if __name__ == "__main__":
    cart = {"cart", "--method=cart"}.intersection(sys.argv[1:])  # scikit-learn does it
    bag = any(word == "--bag" or word.startswith("--bag=") for word in sys.argv[1:])
    enter("induce", purpose="study" if cart else "bags" if bag else "run")
