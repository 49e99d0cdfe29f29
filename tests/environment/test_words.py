"""What the set-up says when it cannot do its work."""

from __future__ import annotations

import errno
import io
import os
import sys
from pathlib import Path

import pytest
from environment.child import ChildError, explain, explain_refusal
from environment.progress import Step, say


@pytest.mark.parametrize(
    ("number", "words"),
    [
        (errno.ENOSPC, "no space left on the disk"),
        (errno.EDQUOT, "no space left on the disk"),
        (errno.EROFS, "/c/.setup is not writable"),
        (errno.EACCES, "/c/.setup is not writable"),
        (errno.EIO, "Input/output error (/c/.setup)"),
    ],
)
def test_what_the_system_refuses_becomes_one_line(number: int, words: str) -> None:
    line = str(explain_refusal(OSError(number, os.strerror(number), "/c/.setup"), Path("/c")))
    assert words in line
    assert "\n" not in line


@pytest.mark.parametrize(
    ("output", "words"),
    [
        (
            "WARNING: Retrying ... Failed to establish a new connection: [Errno 111]\nERROR: No matching",
            "package index",
        ),
        ("error: Request failed: dns error: failed to lookup address", "package index"),
        ("cc1: fatal error: error writing to /tmp/x.s: No space left on device", "no space left"),
    ],
)
def test_an_outside_reason_is_recognised_in_what_a_program_wrote(output: str, words: str, tmp_path: Path) -> None:
    error = explain(ChildError(output, tmp_path / "log"), "installing", tmp_path)
    assert words in str(error)
    assert error.details == ""


def test_when_colcon_breaks_down_over_a_setup_py_its_own_traceback_is_left_out(tmp_path: Path) -> None:
    output = (
        "Traceback (most recent call last):\nValueError: no such version\n--- stderr: bad\n"
        'File "/site-packages/colcon_core/executor.py", line 1\n---\nFailed   <<< bad [0.1s, exited with code 1]\n'
    )
    error = explain(ChildError(output, tmp_path / "log"), "building bad", tmp_path)
    assert error.details.splitlines()[-1] == "ValueError: no such version"


def test_any_other_failure_shows_the_end_of_what_the_failed_package_wrote(tmp_path: Path) -> None:
    output = (
        "--- stderr: good\nwarning: x\n---\nFinished <<< good [1s]\n"
        "--- stderr: bad\nmsg/A.msg:1: syntax\n---\nFailed   <<< bad [0.1s, exited with code 1]\n\nSummary: 1 failed\n"
    )
    error = explain(ChildError(output, tmp_path / "log"), "building good, bad", tmp_path)
    assert error.details == "msg/A.msg:1: syntax"
    assert "building bad failed" in str(error)
    assert str(tmp_path / "log") in str(error)


class Terminal(io.StringIO):
    """A stderr that says it is a terminal."""

    def isatty(self) -> bool:
        return True


def test_on_a_terminal_a_step_keeps_to_one_line_of_its_width(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "40")
    step = Step(2, 3, "installing 160 packages one by one")
    step.tick("Collecting something with a long name")
    step.done()
    shown = [line.removeprefix("\x1b[K") for line in terminal.getvalue().split("\r")]
    assert shown[0] == "[set-up 2/3] installing 160 packages on"
    assert shown[1] == "[set-up 2/3]   0 s  installing 160 pack"
    assert shown[2] == "[set-up 2/3] installing 160 packages one by one ... 0.0 s\n"


def test_elsewhere_a_step_is_two_lines(monkeypatch: pytest.MonkeyPatch) -> None:
    file = io.StringIO()
    monkeypatch.setattr(sys, "stderr", file)
    step = Step(1, 1, "building a")
    step.tick("Starting >>> a")
    step.done()
    assert file.getvalue() == "[set-up 1/1] building a ...\n[set-up 1/1] done in 0.0 s\n"


def test_a_stderr_that_is_gone_stops_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    gone = io.StringIO()
    gone.close()
    monkeypatch.setattr(sys, "stderr", gone)
    with pytest.raises(ValueError, match="closed"):
        gone.write("")
    for stderr in (gone, None):
        monkeypatch.setattr(sys, "stderr", stderr)
        say("nobody hears this")
        Step(1, 1, "nor this").done()
