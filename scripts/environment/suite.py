"""`scripts/test.py`: the test suite, in the environment. The arguments go to pytest."""

import os
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def main(argv: list[str]) -> int:
    """Run pytest on the checkout, wherever it is started from; without arguments the whole suite but the long tests."""
    arguments = [absolute(argument) for argument in argv]
    os.chdir(ROOT)
    sys.stdout.flush()
    os.execv(sys.executable, [sys.executable, "-m", "pytest", "-m", "not long", *arguments])


def absolute(argument: str) -> str:
    """`argument`, made absolute when it names a file or a directory (or a test in one) from where we were started."""
    path, separator, test = argument.partition("::")
    return str(Path(path).resolve()) + separator + test if path and Path(path).exists() else argument
