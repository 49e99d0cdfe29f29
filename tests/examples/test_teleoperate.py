"""The bags of the rooms are recorded and become a tree, by the commands of examples/rooms/README.md."""

from __future__ import annotations

import runpy
import sys
from pathlib import Path

import pytest
from commands import induce
from fbql_behaviors.storage import load_tree
from fbql_studies.rooms.tree_source import SHIPPED
from places import ROOT

PLACE = ROOT / "examples" / "rooms"


def test_a_drive_is_recorded_and_becomes_a_tree(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    drives = tmp_path / "drives"
    monkeypatch.setattr(sys, "argv", ["teleoperate.py", str(drives), "--rooms", "1"])
    runpy.run_path(str(PLACE / "teleoperate.py"), run_name="__main__")
    assert capsys.readouterr().out == f"1 of 1 goals reached; bags in {drives}\n"
    (bag,) = drives.iterdir()
    out = tmp_path / "way_round.json"
    assert induce(["way_round", "--bag", str(bag), "--spec", str(PLACE / "behavior.yaml"), "--out", str(out)]) == 0
    made, shipped = load_tree(out), load_tree(SHIPPED)
    assert made.recipe == shipped.recipe
    assert made.features == shipped.features
    assert made.commands == shipped.commands
