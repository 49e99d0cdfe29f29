"""Every command that writes, on real file systems with no room at all, a few KB, half and most of what it writes, and the
same for the number of files (fault 78): one line, no traceback, and no partial files."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from bringup_run import in_namespace
from commands import demonstrate
from fbql.pictures import episode
from places import ROOT
from recorded_match import TREES, record_match

FULL = "No space left on device"
OLD = "what was there before"
WALL = str(TREES / "wall_avoiding.json")


ARRAYS = {
    "feature": [0, -2, -2], "threshold": [0.5, -2.0, -2.0], "children_left": [1, -1, -1], "children_right": [2, -1, -1],
    "value": [[0.0, 0.0], [1.0, 2.0], [3.0, 4.0]], "n_node_samples": [9, 4, 5],
}  # fmt: skip


class Writer(NamedTuple):
    """A command that writes."""

    words: list[str]
    """With {disk}, the small file system, and {inputs}, a directory of what it reads."""
    before: tuple[str, ...] = ()
    """Names of files that are there before, and that only a whole one may replace."""
    fills: list[tuple[int, int]] | None = None
    """Free pages and inodes, unless they follow from what the command used."""


MANY = 1000
"""Pages or inodes enough."""
WRITERS = {
    "train": Writer(["--controller", "fbql_literal", "--episodes", "2", "--max-steps", "60", "--out", "{disk}/run"]),
    "demonstrate": Writer(["ball_seeking", "--demonstrations", "3", "--steps", "40", "--out", "{disk}/a/demos"]),
    "demonstrate, merge": Writer(["--merge", "{inputs}/demonstrations", "--out", "{disk}/merged"]),
    "induce": Writer(
        ["wall_avoiding", "--demos", "{inputs}/demonstrations", "--trials", "20", "--out", "{disk}/new/tree.json",
         "--report", "{disk}/tree.html", "--curve", "{disk}/curve.csv"],
        ("tree.html", "curve.csv"),
    ),
    "tree, export": Writer(["export", WALL, "--to", "c", "--out", "{disk}/tree.c"], ("tree.c",)),
    "tree, import": Writer(
        ["import", "{inputs}/arrays.json", "--behavior", "ball_seeking", "--out", "{disk}/tree.json"], ("tree.json",)
    ),
    "tune": Writer(["wall_avoiding", "--episodes", "1", "--starts", "1", "--out", "{disk}/a/b/tree.json"]),
    "make_trees": Writer(["--out", "{disk}/trees"]),
    "replay": Writer(
        ["{inputs}/run", "--set", "weight_gain=0.01", "--csv", "{disk}/steps.csv", "--figure", "{disk}/figure.svg"],
        ("steps.csv", "figure.svg"),
    ),
    "recover": Writer(["{inputs}/killed", "--allow-incomplete", "--out", "{disk}/recovered"]),
    "report": Writer(["{inputs}/run", "--out", "{disk}/page.html", "--force"], ("page.html",)),
    "report, figures": Writer(["{inputs}/run", "--out", "{disk}/page.html", "--figures"]),
    "compare": Writer(["{inputs}/run", "{inputs}/other", "--figure", "{disk}/figure.svg", "--force"], ("figure.svg",)),
    "experiment": Writer(["probe", "--place", "{inputs}", "--out", "{disk}/study", "--jobs", "2"]),
    "sweep": Writer(["--seeds", "1", "--controller", "subsumption", "--episodes", "1", "--out", "{disk}/sweep", "--jobs", "1"]),
    "bringup": Writer(
        ["--controller", "subsumption", "--episodes", "1", "--processes", "one", "--out", "{disk}/run"],
        fills=[(0, MANY), (4, MANY), (24, MANY), (MANY, 0), (MANY, 5)],
    ),
    episode.__name__: Writer(["{inputs}/run", "--out", "{disk}/picture.svg"], ("picture.svg",)),
}  # fmt: skip


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("inputs")
    record_match(place / "run", max_steps=120)
    record_match(place / "other", max_steps=120, seed=4)
    record_match(place / "killed", max_steps=120, close=False)
    words = ["wall_avoiding", "--demonstrations", "4", "--steps", "30", "--out", str(place / "demonstrations")]
    assert demonstrate(words) == 0
    (place / "arrays.json").write_text(json.dumps(ARRAYS))
    return place


def reports_of(name: str, inputs: Path, disk: Path) -> list[dict[str, Any]]:
    """What became of the command on each file system; the first has room."""
    writer = WRITERS[name]
    asked = {
        "command": name.partition(",")[0],
        "words": [word.replace("{inputs}", str(inputs)) for word in writer.words],
        "before": dict.fromkeys(writer.before, OLD),
        "fills": writer.fills,
    }
    disk.mkdir()
    path = os.pathsep.join(entry for entry in sys.path if entry)
    done = subprocess.run(
        [*in_namespace("true"), sys.executable, str(ROOT / "tests/helpers/tiny_disk.py"), str(disk)],
        input=json.dumps(asked), env={**os.environ, "PYTHONPATH": path}, capture_output=True, text=True, timeout=300,
        check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.mark.parametrize("name", WRITERS)
def test_a_full_disk_is_reported_in_one_line_and_leaves_no_partial_file(
    name: str, inputs: Path, tmp_path: Path
) -> None:
    if name == "report, figures":
        pytest.importorskip("pyarrow", reason="Parquet needs the extra studies")
    disk = tmp_path / "disk"
    room, *full = reports_of(name, inputs, disk)
    assert room["code"] == 0, room["stderr"]
    assert len(room["files"]) > 0
    before = dict.fromkeys(WRITERS[name].before, OLD)
    assert all(room["files"][file] != OLD for file in before), "it writes what it should not harm"
    assert len(full) >= 2
    for report in full:
        check(name, report, before, room["files"], disk)


def check(name: str, report: dict[str, Any], before: dict[str, str], whole: dict[str, str], disk: Path) -> None:
    """What a report of a full disk must say."""
    said, files = report["stderr"].splitlines(), report["files"]
    assert report["code"] in ((1, 2, 3) if name in GO_ON else (1, 2)), report
    assert "Traceback" not in report["stderr"], report
    about = [line for line in said if FULL in line]
    assert len(about) == 1, report
    assert str(disk) in about[0], report
    assert report["code"] == 3 or "make room" in about[0], report
    assert not [file for file in files if file.endswith(".tmp") or "room_for" in file], report
    if report["code"] == 3:
        assert files.keys() <= whole.keys(), report
        assert '"incomplete": true' in files["run/summary.json"], report
    elif name in ("experiment", "sweep"):  # whole results stay: the same command resumes
        assert files.keys() <= whole.keys(), report
        assert all(json.loads(text) for file, text in files.items() if file.endswith(".json")), report
        assert 0 not in report["free"] or not files, "there was no room to begin"
    elif name == "replay" and files != before:  # the table was whole before there was no room for the figure
        assert files == {**before, "steps.csv": whole["steps.csv"]}, report
    elif name == "induce" and files != before:
        assert files.keys() <= whole.keys(), report
        assert all(files[file] in (OLD, whole[file]) for file in before), report
    elif name == "make_trees" and files != before:
        assert files.items() <= whole.items(), report
    else:
        assert files == before, report


GO_ON = ("train", "bringup")
"""A match that has begun is played to its end, and its result is incomplete."""
