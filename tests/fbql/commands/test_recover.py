"""`scripts/recover.py` as a process: on runs whose fusion node was killed at any moment, and on what is no run."""

from __future__ import annotations

import errno
import json
import os
import random
import signal
import subprocess
import sys
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from time import monotonic

import pytest
from bringup_run import Run
from commands import recover
from fbql_recording.run import open_run
from javascript_reader import IS_THERE, read_with_javascript
from measure.command_process import LATE_S
from places import ROOT
from recorded_match import record_match
from rosbags.highlevel import AnyReader
from run_directory_reader import finalised, parameters_of, summary_of
from verified_run import verification_of

Start = Callable[..., Run]
WITNESS = ROOT / "tests" / "helpers" / "command_witness.py"


class Witness:
    """Another process that hears every command of a run, and when."""

    def __init__(self, run: Run) -> None:
        run.until(lambda: run.domain_id is not None, "its domain is known")
        self._path = run.place / "commands.txt"
        self._popen = subprocess.Popen(
            [sys.executable, str(WITNESS), str(run.domain_id), str(self._path)],
            env={**os.environ, "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", "ROS_LOG_DIR": str(run.place)},
        )
        run.until(lambda: self._path.exists() and self._path.stat().st_size, "the first command is heard")

    def heard(self) -> list[tuple[float, tuple[int, int]]]:
        """When each command came [s], and its episode and step. Ends it."""
        self.close()
        lines = [line.split() for line in self._path.read_text().splitlines(keepends=True) if line.endswith("\n")]
        return [(int(time_ns) / 1e9, (int(episode), int(step))) for time_ns, episode, step in lines]

    def close(self) -> None:
        self._popen.kill()
        self._popen.wait()


def kill_fusion_after(run: Run, delay_s: float) -> tuple[Path, float, list[tuple[float, tuple[int, int]]]]:
    """Kills the fusion node so long after its commands are heard; gives the recording, when, and the commands."""
    witness = Witness(run)
    try:
        begun = monotonic()
        run.until(lambda: monotonic() - begun >= delay_s, f"{delay_s:.3f} s have passed")
        fusion = run.nodes()["fusion"]
        killed_s = monotonic()
        os.kill(fusion, signal.SIGKILL)
        assert run.exit_code() == 1
        (active,) = run.out.glob("*.active")
        return active, killed_s, witness.heard()
    finally:
        witness.close()


def check_killed(start: Start, seed: int) -> None:
    """Plays, kills fusion at a random moment, recovers, and reads the result with everything there is."""
    delay_s = random.Random(seed).uniform(1.0, 4.0)
    run = start("--controller", "fbql_literal", "--guided", "2", "--episodes", "100000", "--seed", str(seed))
    active, killed_s, heard = kill_fusion_after(run, delay_s)
    size = active.stat().st_size
    command = start(str(run.out), "--json", script="recover.py", out=False)
    assert command.exit_code() == 3, command.stderr
    found = json.loads(command.stdout)
    recovered = Path(found["path"])
    assert active.stat().st_size == size
    # All that was written is there, but for the chunk that the kill came in the middle of.
    assert found["chunks_lost"] <= 1
    assert sum(loss["end"] - loss["begin"] for loss in found["lost"]) < 2**18
    assert found["messages"] > 0
    assert (found["cut_off"], found["complete"]) == (True, False)
    assert finalised(recovered) == found["messages"]
    steps = list(open_run(recovered).steps())
    assert found["steps"] == len(steps)
    assert all(step.world and step.command and step.decision for step in steps[:-1])
    # What was decided earlier than a flush period before the kill is there.
    last = (steps[-1].episode, steps[-1].step)
    lost = [came_s for came_s, step in heard if step > last]
    assert len(lost) < len(heard), "nothing that was heard was recorded"
    assert killed_s - min(lost, default=killed_s) <= parameters_of(run.out)["fusion"]["flush_period_s"] + LATE_S
    verified = verification_of(recovered)
    assert (verified.difference, verified.steps + verified.unfinished) == (None, len(steps))
    assert summary_of(recovered)["incomplete"] is True
    with AnyReader([recovered]) as reader:
        assert sum(1 for _ in reader.messages()) == reader.message_count == found["messages"]
    if not IS_THERE:
        warnings.warn("no Node.js, or not its modules: not read with @mcap/core", stacklevel=2)
        return
    read = read_with_javascript(recovered / f"{recovered.name}_0.mcap")
    assert read["streamed"] == read["indexed"] == found["messages"]


def test_what_a_kill_leaves_is_recovered_to_within_the_flush_period(start: Start) -> None:
    """Fault 46."""
    check_killed(start, 1)


@pytest.mark.long
@pytest.mark.parametrize("seed", [0, *range(2, 20)])
def test_what_any_kill_leaves_is_recovered_to_within_the_flush_period(start: Start, seed: int) -> None:
    """Fault 46, nineteen times more."""
    check_killed(start, seed)


@pytest.fixture(scope="module")
def killed(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    yield record_match(tmp_path_factory.mktemp("killed") / "run", close=False)


def test_the_result_is_told_in_words_with_exit_code_3(killed, tmp_path, capsys):
    assert recover([str(killed), "--out", str(tmp_path / "new")]) == 3
    assert capsys.readouterr().out.splitlines() == [
        "recovered 732 messages, 122 steps",
        f"damaged, but without loss: {killed}: no metadata.yaml: the recording was not finished",
        "lost: run_0.mcap.active: the file was cut off; anything after the last flush is missing",
        f"recording  {tmp_path / 'new'}",
    ]
    assert recover([str(killed), "--allow-incomplete", "--out", str(tmp_path / "other")]) == 0


def test_what_is_whole_is_copied_with_exit_code_0(tmp_path, capsys):
    whole = record_match(tmp_path / "whole")
    assert recover([str(whole), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["messages"], found["steps"], found["chunks_lost"]) == (732, 122, 0)
    assert found["path"] == str(tmp_path / "whole_recovered")
    verified = verification_of(Path(found["path"]))
    assert (verified.difference, verified.steps) == (None, 122)


@pytest.mark.parametrize("content", [None, b"", b"no recording\n"])
def test_what_is_no_recording_is_one_line_and_exit_code_2(tmp_path, capsys, content):
    """Fault 49."""
    path = tmp_path / "x.mcap"
    if content is not None:
        path.write_bytes(content)
    assert recover([str(path)]) == 2
    said = capsys.readouterr().err
    assert said.startswith(f"recover.py: {path}: ")
    assert said.count("\n") == 1
    assert not list(tmp_path.glob("*recovered*"))


def test_a_disk_that_is_full_is_one_line_and_leaves_nothing(killed, start, tmp_path):
    """Here it is full for this process, at 10 kB."""
    limit = ["prlimit", "--fsize=10240"]
    command = start(str(killed), "--out", str(tmp_path / "new"), script="recover.py", before=limit, out=False)
    assert command.exit_code() == 1
    new = tmp_path / "new"
    assert (
        command.stderr
        == f"recover.py: {new}: cannot be written (File too large); nothing was written; make room there, or choose another place\n"
    )
    assert not new.exists()


def test_a_directory_that_cannot_be_made_is_one_line(killed, tmp_path, capsys):
    (tmp_path / "file").write_bytes(b"")
    assert recover([str(killed), "--out", str(tmp_path / "file" / "new")]) == 2
    said = capsys.readouterr().err
    assert said.startswith(f"recover.py: {tmp_path / 'file' / 'new'}: ")
    assert said.count("\n") == 1


def test_a_write_error_of_any_kind_names_the_new_directory(killed, tmp_path, capsys, monkeypatch):
    """Here the file system turns read-only when the recording is finished."""

    def fail(*_: object) -> None:
        raise OSError(errno.EROFS, os.strerror(errno.EROFS))

    monkeypatch.setattr(os, "fsync", fail)
    new = tmp_path / "new"
    assert recover([str(killed), "--out", str(new)]) == 1
    assert capsys.readouterr().err == (
        f"recover.py: {new}: cannot be written (Read-only file system); nothing was written; choose another place\n"
    )
    assert not new.exists()
