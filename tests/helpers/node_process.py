"""One of our executables as a real process."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
from collections.abc import Mapping, Sequence
from pathlib import Path
from time import monotonic

import pytest
from ament_index_python.packages import get_package_prefix
from measure.command_process import take_terminal
from patience import PATIENCE_S


class NodeProcess:
    """One of our executables as a real process, with its output. `terminal` becomes its controlling one, and its stdin."""

    def __init__(
        self,
        package: str,
        executable: str,
        arguments: Sequence[str],
        directory: Path,
        environment: Mapping[str, str],
        terminal: int | None = None,
    ) -> None:
        path = Path(get_package_prefix(package)) / "lib" / package / executable
        self.name = executable
        self._output = directory / f"{executable}-{id(self)}.txt"
        with self._output.open("wb") as output:
            self.popen = subprocess.Popen(
                [str(path), *arguments],
                cwd=directory,
                env={**os.environ, **environment},
                stdin=subprocess.DEVNULL if terminal is None else terminal,
                stdout=output,
                stderr=subprocess.STDOUT,
                start_new_session=terminal is not None,
                preexec_fn=None if terminal is None else take_terminal,
            )

    def printed(self) -> str:
        """Its output so far."""
        return self._output.read_text(errors="replace")

    def until_printed(self, text: str) -> None:
        """Waits until its output contains a text."""
        deadline = monotonic() + PATIENCE_S
        while text not in self.printed():
            if self.popen.poll() is not None:
                pytest.fail(f"{self.name} ended with {self.popen.returncode} instead of '{text}':\n{self.printed()}")
            if monotonic() > deadline:
                pytest.fail(f"waited {PATIENCE_S:g} s for {self.name} to print '{text}':\n{self.printed()}")
            with contextlib.suppress(subprocess.TimeoutExpired):
                self.popen.wait(0.02)

    def send(self, number: signal.Signals) -> None:
        """Signals the process."""
        self.popen.send_signal(number)

    def exit_code(self, timeout_s: float = PATIENCE_S) -> int:
        """Waits for its end, and returns its exit code."""
        try:
            return self.popen.wait(timeout_s)
        except subprocess.TimeoutExpired:
            pytest.fail(f"waited {timeout_s:g} s for {self.name} to end:\n{self.printed()}")

    def cpu_s(self) -> float:
        """Processor time used so far [s]."""
        fields = Path(f"/proc/{self.popen.pid}/stat").read_text().rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

    def cpu_share(self, duration_s: float) -> float:
        """Processor time it uses in the next `duration_s`, as a share of one core."""
        began_s, used_s = monotonic(), self.cpu_s()
        with contextlib.suppress(subprocess.TimeoutExpired):
            self.popen.wait(duration_s)
            pytest.fail(f"{self.name} ended with {self.popen.returncode}:\n{self.printed()}")
        return (self.cpu_s() - used_s) / (monotonic() - began_s)

    def close(self) -> None:
        if self.popen.poll() is None:
            self.popen.kill()
            self.popen.wait(PATIENCE_S)
