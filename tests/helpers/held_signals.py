"""Waits for a process that is being loaded to make signals wait."""

import re
import signal
import subprocess
from pathlib import Path


def until_interrupts_wait(popen: subprocess.Popen[str]) -> None:
    """Returns as soon as the process holds SIGINT back."""
    blocked, interrupt = 0, 1 << (signal.SIGINT - 1)
    while not blocked & interrupt:
        assert popen.poll() is None, "it never made signals wait"
        status = Path(f"/proc/{popen.pid}/status").read_text()
        blocked = int(re.search(r"^SigBlk:\s*(\w+)$", status, re.MULTILINE)[1], 16)
