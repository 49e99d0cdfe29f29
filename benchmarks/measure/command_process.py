"""One of our commands as a process, with everything that it starts: for the study of kills, and for the tests.

All its processes carry a unique mark in their environment, by which they, and no others, are found.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import re
import signal
import subprocess
import termios
import uuid
from collections.abc import Mapping, Sequence
from pathlib import Path

NODES = ("simulator", "ball_seeking", "wall_avoiding", "approaching", "fusion")
LATE_S = 0.3
"""How late a timer may fire on a busy machine [s]."""
_MARK = "FBQL_PROCESS_MARK"
_DOMAIN = re.compile(r"ROS_DOMAIN_ID=(\d+)")


class CommandProcess:
    """A command that runs in its own session.

    Args:
        command: the program and its arguments.
        place: its working directory, which also gets its output.
        environment: its variables, without the mark.
        terminal: descriptor of a terminal, which becomes its controlling terminal and receives its stderr.
    """

    def __init__(
        self, command: Sequence[str], place: Path, environment: Mapping[str, str], terminal: int | None = None
    ) -> None:
        self._mark = f"{_MARK}={uuid.uuid4().hex}"
        self._stdout, self._stderr = place / "stdout.txt", place / "stderr.txt"
        name, value = self._mark.split("=")
        with self._stdout.open("wb") as stdout, self._stderr.open("wb") as stderr:
            self.popen = subprocess.Popen(
                command,
                env={**environment, name: value},
                cwd=place,
                stdin=subprocess.DEVNULL if terminal is None else terminal,
                stdout=stdout,
                stderr=stderr if terminal is None else terminal,
                start_new_session=True,
                preexec_fn=_heed_signals if terminal is None else take_terminal,
            )

    @property
    def stdout(self) -> str:
        return self._stdout.read_text(errors="replace")

    @property
    def stderr(self) -> str:
        return self._stderr.read_text(errors="replace")

    @property
    def domain_id(self) -> int | None:
        """The domain of its graph; None before it is printed."""
        found = _DOMAIN.search(self.stderr)
        return None if found is None else int(found[1])

    def processes(self) -> dict[int, str]:
        """The command lines of all its processes, by process id."""
        found: dict[int, str] = {}
        for directory in Path("/proc").iterdir():
            if directory.name.isdigit():
                with contextlib.suppress(OSError):
                    if self._mark.encode() in (directory / "environ").read_bytes().split(b"\0"):
                        found[int(directory.name)] = (directory / "cmdline").read_bytes().replace(b"\0", b" ").decode()
        return found

    def ros_processes(self) -> dict[int, str]:
        """The command lines of its nodes' processes, by process id."""
        return {pid: line for pid, line in self.processes().items() if "--ros-args" in line}

    def nodes(self) -> dict[str, int]:
        """Process ids of the nodes that run in their own process, by name."""
        lines = self.ros_processes()
        return {name: pid for name in NODES for pid, line in lines.items() if f"/{name} " in line}

    def kill(self) -> None:
        """Kills all its remaining processes."""
        self.popen.kill()
        self.popen.wait()
        for pid in self.processes():
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)


def _heed_signals() -> None:
    """Signals do what they do by default, also where ours are ignored: under nohup, or in the background of a shell."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_DFL)


def take_terminal() -> None:
    """Makes the terminal that is stdin the controlling one, so that it sends its signals here."""
    _heed_signals()
    fcntl.ioctl(0, termios.TIOCSCTTY, 0)
