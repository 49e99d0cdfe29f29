"""Processes of the graph: each leads its own session, ends with the launcher, and writes its output to a file."""

from __future__ import annotations

import contextlib
import ctypes
import os
import signal
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from time import monotonic, sleep

from fbql_common.spin import SUPERVISED

_PR_SET_PDEATHSIG = 1
_LIBC = ctypes.CDLL(None, use_errno=True)
_TAIL_LINES = 15
PATIENCE_S = (1.0, 3.0)
"""How long a process may take to end after SIGINT, and then after SIGTERM, before the next signal is sent [s].

Our nodes end in the same way on both. One that is just starting may lose a SIGINT, but no SIGTERM.
"""


@dataclass
class NodeProcess:
    """One running process of the graph."""

    name: str
    popen: subprocess.Popen[bytes]
    log_file: Path

    @property
    def exit_code(self) -> int | None:
        """Its exit code, negative for a signal; None while it runs."""
        return self.popen.poll()

    def send(self, number: signal.Signals) -> None:
        """Signals its whole process group; a process that is gone is ignored."""
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self.popen.pid, number)

    def tail(self) -> str:
        """The end of what it printed."""
        lines = self.log_file.read_text(errors="replace").splitlines()
        return "\n".join(lines[-_TAIL_LINES:])

    def errors(self) -> list[str]:
        """What it logged as an error."""
        lines = self.log_file.read_text(errors="replace").splitlines()
        return [line.partition("]: ")[2] for line in lines if line.startswith("[ERROR]")]


def start(name: str, command: Sequence[str], environment: dict[str, str], log_directory: Path) -> NodeProcess:
    """Starts a process that leads its own session and gets SIGTERM when the launcher dies, in whatever way.

    Must be called from the main thread: the kernel binds the child to the thread that made it.

    Raises:
        OSError: it can't be started, or its log file can't be written.
    """
    log_file = log_directory / f"{name}.log"
    launcher = os.getpid()

    def bind_to_launcher() -> None:
        _LIBC.prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)
        if os.getppid() != launcher:
            os._exit(1)

    with log_file.open("wb") as output:
        popen = subprocess.Popen(
            list(command),
            env={**environment, SUPERVISED: "1"},
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=subprocess.STDOUT,
            start_new_session=True,
            preexec_fn=bind_to_launcher,
        )
    return NodeProcess(name, popen, log_file)


def stop(processes: Sequence[NodeProcess]) -> list[str]:
    """Ends processes by SIGINT, then SIGTERM, then SIGKILL, within the sum of PATIENCE_S. Returns the names of those killed."""
    for number, patience_s in zip((signal.SIGINT, signal.SIGTERM), PATIENCE_S, strict=True):
        running = [process for process in processes if process.exit_code is None]
        for process in running:
            process.send(number)
        deadline = monotonic() + patience_s
        while any(process.exit_code is None for process in running) and monotonic() < deadline:
            sleep(0.01)
    killed = [process for process in processes if process.exit_code is None]
    for process in killed:
        process.send(signal.SIGKILL)
        process.popen.wait()
    return [process.name for process in killed]
