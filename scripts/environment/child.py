"""Running the programs that do the set-up's work: Python, pip, uv, colcon."""

from __future__ import annotations

import contextlib
import errno
import os
import re
import shutil
import signal
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path

from .progress import SetUpError, Step
from .signals import ENDING_SIGNALS

POLL_S = 0.2
PATIENCE_S = 3.0
SHOWN_LINES = 40
ALMOST_FULL = 8 * 2**20
NO_SPACE = re.compile("No space left on device|Disk quota exceeded|ENOSPC")
NO_NETWORK = re.compile(
    "Failed to establish a new connection|NewConnectionError|Temporary failure in name resolution|Name or service not known"
    "|Network is unreachable|Connection refused|Connection timed out|ConnectTimeoutError|ReadTimeoutError"
    "|Max retries exceeded|Could not connect|dns error|ProxyError"
)


class ChildError(Exception):
    """A program of the set-up ended with an error; `output` is all that it wrote, which is in the file `log` too."""

    def __init__(self, output: str, log: Path) -> None:
        super().__init__(output)
        self.output = output
        self.log = log


def explain(failure: ChildError, work: str, root: Path) -> SetUpError:
    """The line for a failed program: known reasons in words, any other with the end of its output."""
    output = failure.output
    if free_bytes(str(root)) < ALMOST_FULL or NO_SPACE.search(output):
        return no_space(root)
    if NO_NETWORK.search(output):
        return SetUpError(
            "the package index cannot be reached. Check the network, the proxy (https_proxy) and pip's index settings, "
            f"then start again; what was downloaded is kept. Log: {failure.log}"
        )
    failed = re.search(r"^Failed +<<< (\S+)", output, flags=re.MULTILINE)
    if failed:
        work = f"building {failed[1]}"
        shown = re.search(rf"^--- stderr: {re.escape(failed[1])}\n(.*?)^---$", output, flags=re.MULTILINE | re.DOTALL)
        if shown:
            # When a setup.py raises, colcon itself crashes: the relevant message precedes colcon's own traceback.
            output = output[: shown.start()] if "/colcon_core/" in shown[1] else shown[1]
    details = "\n".join([line for line in output.splitlines() if line.strip()][-SHOWN_LINES:])
    return SetUpError(f"{work} failed. Fix the problem shown above and start again. Log: {failure.log}", details)


def explain_refusal(error: OSError, root: Path) -> SetUpError:
    """The line for an OSError met while the set-up wrote into the checkout `root`."""
    if error.errno in (errno.ENOSPC, errno.EDQUOT):
        return no_space(root)
    place = error.filename or root
    if error.errno in (errno.EACCES, errno.EPERM, errno.EROFS):
        return SetUpError(
            f"{place} is not writable; make it so, or clone into a directory of your own, and start again."
        )
    return SetUpError(f"the set-up failed: {error.strerror or error} ({place}). Fix that and start again.")


def no_space(root: Path) -> SetUpError:
    """The line for a full disk; states the free space where the set-up writes."""
    places = sorted({str(root), tempfile.gettempdir()})
    free = ", ".join(f"{place}: {free_bytes(place) // 2**20} MiB free" for place in places)
    return SetUpError(f"no space left on the disk ({free}); the set-up needs about 1.5 GiB. Free some and start again.")


def free_bytes(path: str) -> int:
    """Bytes that an ordinary user can still write at `path`; 0 where it cannot be asked."""
    try:
        return shutil.disk_usage(path).free
    except OSError:
        return 0


def run(command: Sequence[str], *, environ: dict[str, str], log: Path, lock: int, step: Step, cwd: Path) -> None:
    """Run `command` to its end; its output goes to the file `log`. Raises ChildError.

    It inherits the lock, so that other set-ups still wait for it if this process is killed, and it writes to a file
    rather than to us, so that our death does not stop it half-way. It gets its own session: an interrupt at the
    terminal reaches only us, and we end it together with its own children.
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
    if code != 0:
        raise ChildError(log.read_bytes().decode(errors="replace"), log)


def end_group(child: subprocess.Popen[bytes]) -> None:
    """End a child and all of its own children: two requests, then SIGKILL; at once when we are interrupted again."""
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
    lines = log.read_bytes()[-8192:].decode(errors="replace").splitlines()
    shown = (line.strip() for line in reversed(lines) if not line.startswith(("WARNING", "Looking in", " ", "[")))
    return "".join(character for character in next(shown, "") if character.isprintable())
