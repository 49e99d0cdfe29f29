"""`scripts/bringup.py` as a real process: started, watched, signalled, and what it leaves behind."""

from __future__ import annotations

import contextlib
import fcntl
import os
import pty
import select
import signal
import struct
import subprocess
import sys
import termios
import threading
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from time import monotonic

import pytest
from measure.command_process import CommandProcess
from patience import PATIENCE_S
from places import ROOT

BEHAVIORS = ("ball_seeking", "wall_avoiding", "approaching")
END_S = 5.0
"""Within this everything has ended after it was asked to (faults 27 and 28) [s]."""
HOSTILE = {
    "ROS_LOCALHOST_ONLY": "1",
    "ROS_DISCOVERY_SERVER": "127.0.0.1:11811",
    "RMW_IMPLEMENTATION": "rmw_nothing_cpp",
    "RCUTILS_LOGGING_USE_STDOUT": "1",
    "PYTHONIOENCODING": "ascii",
    "LC_ALL": "C",
    "COLUMNS": "wide",
    "LINES": "-1",
}
"""Variables that a command reports, sets aside or works with, and that change no result."""
_PERSONAL = ("ROS_DOMAIN_ID", "ROS_LOG_DIR", "ROS_HOME", "ROS_SECURITY_ENABLE", "ROS_AUTOMATIC_DISCOVERY_RANGE")
_NAMESPACE = ("unshare", "--user", "--map-root-user", "--mount")


class Run(CommandProcess):
    """One command of ours as a process.

    Args:
        place: a directory of its own: its output goes there, and its run to `out` there.
        script: an entry in scripts/.
        before: a command that this one is given to, such as `in_namespace`.
        environment: variables on top of the tests' own, from which what is personal to a user is taken.
        terminal: becomes its controlling one, and takes its stderr.
        from_a_shell: as from a user's shell, by a python3 that is not the environment's and with nothing set for it.
    """

    def __init__(
        self,
        place: Path,
        arguments: Sequence[str] = (),
        *,
        script: str = "bringup.py",
        before: Sequence[str] = (),
        environment: Mapping[str, str | None] | None = None,
        terminal: Terminal | None = None,
        from_a_shell: bool = False,
    ) -> None:
        self.place = place
        self.out = place / "run"
        own = {**dict.fromkeys(_PERSONAL), **(environment or {})}
        merged = {**({"PATH": os.defpath, "HOME": str(place)} if from_a_shell else os.environ), **own}
        python = f"{sys.base_prefix}/bin/python3" if from_a_shell else sys.executable
        super().__init__(
            [*before, python, str(ROOT / "scripts" / script), *arguments],
            place,
            {name: value for name, value in merged.items() if value is not None},
            None if terminal is None else terminal.descriptor,
        )
        if terminal is not None:
            os.close(terminal.descriptor)

    def log(self, name: str) -> str:
        """What a process of the graph printed."""
        path = self.out / "log" / f"{name}.log"
        return path.read_text(errors="replace") if path.exists() else ""

    def until(self, condition: Callable[[], object], what: str, timeout_s: float = PATIENCE_S) -> None:
        """Waits until something is so, while it runs."""
        deadline = monotonic() + timeout_s
        while not condition():
            if self.popen.poll() is not None:
                pytest.fail(f"it ended with {self.popen.returncode} instead of: {what}\n{self.stderr}")
            if monotonic() > deadline:
                pytest.fail(f"waited {timeout_s:g} s for: {what}\n{self.stderr}")
            self._pause()

    def until_playing(self) -> None:
        """Waits until an episode has been played."""
        episodes = self.out / "episodes.csv"
        self.until(lambda: episodes.exists() and episodes.read_text().count("\n") > 1, "an episode is played")

    def exit_code(self, timeout_s: float = PATIENCE_S) -> int:
        """Waits for its end."""
        try:
            return self.popen.wait(timeout_s)
        except subprocess.TimeoutExpired:
            pytest.fail(f"waited {timeout_s:g} s for its end\n{self.stderr}")

    def send(self, number: signal.Signals) -> None:
        """Signals the launcher alone."""
        self.popen.send_signal(number)

    def gone_within(self, timeout_s: float) -> None:
        """Waits until no process of it is left."""
        deadline = monotonic() + timeout_s
        while left := self.processes():
            if monotonic() > deadline:
                pytest.fail(f"after {timeout_s:g} s there still are {left}")
            self._pause()

    @staticmethod
    def _pause() -> None:
        """Between two looks."""
        select.select([], [], [], 0.02)


class Terminal:
    """A pseudo-terminal that is read all the time, as a window would."""

    def __init__(self, columns: int = 80, rows: int = 24) -> None:
        self._master, self.descriptor = pty.openpty()
        fcntl.ioctl(self.descriptor, termios.TIOCSWINSZ, struct.pack("4H", rows, columns, 0, 0))
        self._data = b""
        self._closing, self._close = os.pipe()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        while self._closing not in select.select([self._master, self._closing], [], [])[0]:
            try:
                self._data += os.read(self._master, 4096)
            except OSError:  # nobody has it open any more
                return

    @property
    def shown(self) -> str:
        """Everything that was written to it."""
        return self._data.decode()

    def lines(self) -> list[list[str]]:
        """Its lines, each with all that stood in it one after the other; when nobody has it open any more."""
        self._reader.join(END_S)
        assert not self._reader.is_alive(), "somebody still has the terminal open"
        return [line.removesuffix("\r").split("\r") for line in self.shown.split("\n")]

    def type(self, keys: bytes) -> None:
        """Types on its keyboard."""
        os.write(self._master, keys)

    def close(self) -> None:
        """Closes the window: whoever has it as the controlling terminal gets SIGHUP."""
        os.write(self._close, b".")
        self._reader.join()
        for descriptor in (self._master, self.descriptor, self._closing, self._close):
            with contextlib.suppress(OSError):
                os.close(descriptor)


def in_namespace(before: str, after: str = "true") -> list[str]:
    """The command that runs another one with mounts of its own: `before` in a shell, then the command, then `after`.

    Skips the test where that can't be had.
    """
    try:
        done = subprocess.run(
            [*_NAMESPACE, "sh", "-c", before], capture_output=True, text=True, timeout=PATIENCE_S, check=False
        )
    except OSError as error:
        pytest.skip(f"no mount namespaces here: {error}")
    if done.returncode:
        pytest.skip(f"no mount namespaces here: {done.stderr}")
    return [*_NAMESPACE, "sh", "-c", f'{before} && {{ "$@"; code=$?; {after}; exit $code; }}', "sh"]
