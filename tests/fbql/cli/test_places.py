"""Where output goes without --out: a place of its own for every command, also for those of the same second."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from fbql.cli import places
from fbql.demonstrations.recording import make_directory
from fbql_common.core.errors import BadInput

PROGRAM = """
import sys
from fbql.cli import places
path = places.new_path("tree-ball_seeking")
print(path, flush=True)
sys.stdin.read()
if "keep" in sys.argv:
    (path / "ball_seeking.json").write_text("a tree")
"""


def test_two_outputs_of_one_second_have_a_place_each(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(places, "RUNS", tmp_path / "runs")
    found = {places.new_path("demonstrations") for _ in range(5)}
    assert len(found) == 5
    assert all(path.is_dir() for path in found)


def test_commands_that_start_together_have_a_place_each_and_leave_only_what_they_wrote(tmp_path: Path) -> None:
    environ = {name: value for name, value in os.environ.items() if name != "FBQL_CHECKOUT"}
    started = [
        subprocess.Popen(
            [sys.executable, "-c", PROGRAM, word],
            cwd=tmp_path, env=environ, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
        )
        for word in ("keep", "leave", "keep", "leave")
    ]  # fmt: skip
    found = [Path(((each.stdout and each.stdout.readline()) or "").strip()) for each in started]
    assert len(set(found)) == 4
    for each in started:
        each.communicate()
    assert sorted((tmp_path / "runs").iterdir()) == sorted((found[0], found[2]))


def test_a_place_that_was_kept_may_be_written_to_and_no_other(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(places, "RUNS", tmp_path / "runs")
    path = places.new_path("demonstrations")
    make_directory(path)
    (path / "a").touch()
    with pytest.raises(BadInput, match="exists"):
        make_directory(path)
    (tmp_path / "of_somebody").mkdir()
    with pytest.raises(BadInput, match="exists"):
        make_directory(tmp_path / "of_somebody")
