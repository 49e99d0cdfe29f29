"""Signals in the last moments of a process, when Python has taken its own handlers away."""

import signal
import subprocess
import sys

import pytest

LAST_MOMENT = """
import os, sys
from fbql.cli.interrupts import Interrupts

class Last:
    def __del__(self, kill=os.kill, me=os.getpid(), number=int(sys.argv[1])):
        kill(me, number)

last = Last()
Interrupts().install()
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_while_python_ends_leaves_the_exit_code_alone(number: int) -> None:
    ended = subprocess.run([sys.executable, "-c", LAST_MOMENT, str(int(number))], capture_output=True, check=False)
    assert (ended.returncode, ended.stderr) == (0, b"")
