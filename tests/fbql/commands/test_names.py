"""Names that nobody expects, as arguments: refused in one line with exit code 2, or used, and never printed raw."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from commands import compare, demonstrate, induce, recover, replay, report, train, tree, tune
from places import ROOT
from recorded_match import record_match

TREE = str(ROOT / "ros2_ws/src/fbql_behaviors/fbql_behaviors/trees/approaching.json")
LONG = "x" * 300
NO_TEXT = "x\udcff"
FORGED = "x\nreport.py: all is well\x1b[31m\u202e"
OUTPUTS = {
    "train": (train, ("--goals", "1", "--out")),
    "demonstrate": (demonstrate, ("approaching", "--out")),
    "induce": (induce, ("approaching", "--out")),
    "induce --report": (induce, ("approaching", "--report")),
    "induce --curve": (induce, ("approaching", "--curve")),
    "tune": (tune, ("approaching", "--out")),
    "tree export": (tree, ("export", TREE, "--to", "svg", "--out")),
    "recover": (recover, ("RUN", "--out")),
    "report": (report, ("RUN", "--out")),
    "compare": (compare, ("RUN", "RUN", "--figure")),
    "replay --csv": (replay, ("RUN", "--set", "weight_gain=0.05", "--csv")),
}
INPUTS = {
    "report": (report, ()),
    "recover": (recover, ()),
    "replay": (replay, ()),
    "verify": (replay, ("--verify",)),
    "tree check": (tree, ("check",)),
    "demonstrate --replay": (demonstrate, ("approaching", "--replay")),
    "induce --demos": (induce, ("approaching", "--demos")),
    "train --trees": (train, ("--trees",)),
    "train --policy": (train, ("--policy",)),
}


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One short episode. Not to be changed."""
    return record_match(tmp_path_factory.mktemp("recorded") / "run", max_steps=6, episodes=1)


def ended_with(main, words: list[str]) -> int:
    try:
        return main(words)
    except SystemExit as ended:
        return int(ended.code or 0)


def only_line(capsys: pytest.CaptureFixture[str]) -> str:
    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 1), err
    assert err[:-1].isprintable()
    return err


@pytest.mark.parametrize("name", [LONG, NO_TEXT, "é" * 101, "x\0y"], ids=["long", "not UTF-8", "long in bytes", "null"])
@pytest.mark.parametrize("command", OUTPUTS)
def test_an_output_that_can_not_be_called_so_is_refused(recorded, tmp_path, capsys, monkeypatch, command, name):
    monkeypatch.chdir(tmp_path)
    main, words = OUTPUTS[command]
    given = [str(recorded) if word == "RUN" else word for word in words]
    assert ended_with(main, [*given, name]) == 2
    only_line(capsys)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "name", [LONG, NO_TEXT, FORGED, "/".join(["x" * 200] * 30)], ids=["long", "raw", "forged", "deep"]
)
@pytest.mark.parametrize("command", INPUTS)
def test_an_input_that_is_not_there_is_one_line_whatever_its_name(tmp_path, capsys, monkeypatch, command, name):
    monkeypatch.chdir(tmp_path)
    main, words = INPUTS[command]
    assert ended_with(main, [*words, name]) == 2
    only_line(capsys)


@pytest.mark.parametrize("name", [FORGED, "x\udcff"], ids=["forged", "not UTF-8"])
def test_a_recording_in_an_odd_directory_is_read_and_its_name_shown_escaped(tmp_path, capsys, recorded, name):
    directory = tmp_path / name
    recorded_there = directory / "run"
    directory.mkdir()
    recorded_there.mkdir()
    for file in ("metadata.yaml", "run_0.mcap", "config.yaml"):
        (recorded_there / file).write_bytes((recorded / file).read_bytes())
    for main, words in (
        (report, [str(recorded_there), "--out", str(tmp_path / "page.html")]),
        (replay, [str(recorded_there), "--verify"]),
        (recover, [str(recorded_there), "--out", str(tmp_path / "recovered")]),
        (compare, [str(recorded_there), str(recorded)]),
    ):
        assert ended_with(main, words) == 0
        out, err = capsys.readouterr()
        assert all(line.isprintable() for line in (out + err).split("\n"))
        assert not [line for line in (out + err).split("\n") if line.startswith("report.py: all is well")]


def test_a_result_with_a_name_that_ascii_lacks_is_printed(tmp_path):
    code = "import sys; from fbql.cli.app import run; sys.exit(run('train', sys.argv[1:]))"
    words = ["--controller", "subsumption", "--episodes", "1", "--max-steps", "5", "--out", str(tmp_path / "grün")]
    environment = {**os.environ, "PYTHONIOENCODING": "ascii", "PYTHONUTF8": "1"}
    done = subprocess.run([sys.executable, "-c", code, *words], env=environment, capture_output=True, check=False)
    assert (done.returncode, b"Traceback" in done.stderr) == (0, False), done.stderr
    assert b"gr\\xfcn" in done.stdout
