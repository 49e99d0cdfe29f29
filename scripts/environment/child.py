"""Running the programs that do the set-up's work: Python, pip, uv, colcon."""

from __future__ import annotations

import contextlib
import os
import re
import signal
import subprocess
from collections.abc import Sequence
from pathlib import Path

from .errors import SetUpError, free_bytes, no_space
from .progress import Step

ENDING_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
POLL_S = 0.2
PATIENCE_S = 3.0
SHOWN_LINES = 40
NOT_SHOWN = ("WARNING", "Looking in", " ", "[")
ALMOST_FULL = 8 * 2**20

NO_SPACE_WORDS = ("No space left on device", "Disk quota exceeded", "ENOSPC")
NO_NETWORK_WORDS = (
    "Failed to establish a new connection",
    "NewConnectionError",
    "Temporary failure in name resolution",
    "Name or service not known",
    "Network is unreachable",
    "Connection refused",
    "Connection timed out",
    "ConnectTimeoutError",
    "ReadTimeoutError",
    "Max retries exceeded",
    "Could not connect",
    "dns error",
    "ProxyError",
)


class ChildError(Exception):
    """A program of the set-up ended with an error; `output` is all that it wrote, which is in the file `log` too."""

    def __init__(self, command: Sequence[str], code: int, output: str, log: Path) -> None:
        super().__init__(f"{Path(command[0]).name} ended with {code}")
        self.output = output
        self.log = log


def explain(failure: ChildError, doing: str, root: Path) -> SetUpError:
    """The line for a failed program: the known reasons in words, any other with the end of what it wrote."""
    output = failure.output
    if free_bytes(str(root)) < ALMOST_FULL or any(word in output for word in NO_SPACE_WORDS):
        return no_space(str(root))
    if any(word in output for word in NO_NETWORK_WORDS):
        return SetUpError(
            "the package index cannot be reached. Check the network, the proxy (https_proxy) and pip's index settings, "
            f"then start again; what was downloaded is kept. Log: {failure.log}"
        )
    failed = re.search(r"^Failed +<<< (\S+)", output, flags=re.MULTILINE)
    if failed:
        doing = f"building {failed[1]}"
    relevant = [line for line in failed_part(output).splitlines() if line.strip()][-SHOWN_LINES:]
    return SetUpError(
        f"{doing} failed. Mend what is said above and start again. Log: {failure.log}", details="\n".join(relevant)
    )


def failed_part(output: str) -> str:
    """What colcon shows of the package that failed, which need not be the last; else all of the output.

    When a setup.py raises, colcon breaks down over it, with a traceback of its own; what matters is said before that.
    """
    failed = re.search(r"^Failed +<<< (\S+)", output, flags=re.MULTILINE)
    if failed:
        shown = re.search(rf"^--- stderr: {re.escape(failed[1])}\n(.*?)^---$", output, flags=re.MULTILINE | re.DOTALL)
        if shown and "/colcon_core/" in shown[1]:
            return output[: shown.start()]
        if shown:
            return shown[1]
    return output


def run(
    command: Sequence[str], *, environ: dict[str, str], log: Path, lock: int, step: Step, cwd: Path | None = None
) -> str:
    """Run `command` to its end and return its output, which goes to the file `log` as well.

    It inherits the lock, so that it keeps other set-ups waiting should this process be killed, and writes to a file
    rather than to us, so that our death does not stop it half-way. It gets a session of its own: an interrupt at the
    terminal reaches us alone, and we end it together with its own children.
    """
    # A signal that came between the child's start and our knowing of it would leave it running: let it wait.
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, ENDING_SIGNALS)
    child = None
    try:
        with log.open("wb") as output:
            child = subprocess.Popen(
                command,
                env=environ,
                cwd=cwd,
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
                pass_fds=(lock,),
                start_new_session=True,
                preexec_fn=lambda: signal.pthread_sigmask(signal.SIG_SETMASK, mask),
            )
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        while True:
            try:
                code = child.wait(POLL_S)
                break
            except subprocess.TimeoutExpired:
                step.tick(last_line(log))
    except BaseException:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        if child is not None:
            end_group(child)
        raise
    text = log.read_bytes().decode(errors="replace")
    if code != 0:
        raise ChildError(command, code, text, log)
    return text


def end_group(child: subprocess.Popen[bytes]) -> None:
    """End a child and all of its own children: asked twice, then killed; at once when we are interrupted again."""
    try:
        for number in (signal.SIGINT, signal.SIGTERM):
            os.killpg(child.pid, number)
            with contextlib.suppress(subprocess.TimeoutExpired):
                child.wait(PATIENCE_S)
                break
    except ProcessLookupError:
        pass
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(child.pid, signal.SIGKILL)
        child.wait()


def last_line(log: Path) -> str:
    """The last line worth showing of a log that is being written, without control characters."""
    try:
        with log.open("rb") as file:
            file.seek(max(0, os.fstat(file.fileno()).st_size - 8192))
            lines = file.read().decode(errors="replace").splitlines()
    except OSError:
        return ""
    told = (line.strip() for line in reversed(lines) if not line.startswith(NOT_SHOWN))
    return "".join(character for character in next(told, "") if character.isprintable())
