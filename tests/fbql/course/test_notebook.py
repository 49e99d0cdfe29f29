"""The notebook runs from its first cell to its last, its answers are right, and it holds no output."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from fbql.course import lessons
from own_controller import only_ours
from places import ROOT

NOTEBOOK = json.loads((ROOT / "docs" / "course" / "from_python.ipynb").read_text())
CODE = ["".join(cell["source"]) for cell in NOTEBOOK["cells"] if cell["cell_type"] == "code"]


def test_it_is_a_notebook_without_outputs() -> None:
    assert (NOTEBOOK["nbformat"], NOTEBOOK["nbformat_minor"]) == (4, 5)
    ids = [cell["id"] for cell in NOTEBOOK["cells"]]
    assert len(set(ids)) == len(ids)
    code = [cell for cell in NOTEBOOK["cells"] if cell["cell_type"] == "code"]
    assert all((cell["outputs"], cell["execution_count"]) == ([], None) for cell in code)
    assert {cell["cell_type"] for cell in NOTEBOOK["cells"]} == {"code", "markdown"}


def test_its_links_lead_somewhere() -> None:
    text = "\n".join("".join(cell["source"]) for cell in NOTEBOOK["cells"] if cell["cell_type"] == "markdown")
    links = re.findall(r"\]\(([^)]+)\)", text)
    assert links and not [link for link in links if not (ROOT / "docs" / "course" / link).is_file()]


def test_it_runs_and_its_answers_are_right(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(lessons, "WORK", tmp_path / "course")
    names: dict[str, object] = {"__name__": "__main__"}
    with only_ours():
        for cell in CODE:
            exec(compile(cell, "notebook", "exec"), names)
    printed = capsys.readouterr().out
    verdicts = [line for line in printed.splitlines() if line.startswith(("True ", "False "))]
    assert [line.split()[0] for line in verdicts] == ["True"] * 3, printed
