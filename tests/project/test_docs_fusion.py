"""docs/fusion.md tells what the studies of fusion found, as its generator writes it from the committed data."""

from __future__ import annotations

import json
import re
import runpy
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from fbql_studies.runner.study import study_of
from places import ROOT

DOCS = ROOT / "docs"


@cache
def generator() -> dict[str, Any]:
    return runpy.run_path(str(DOCS / "make_fusion.py"))


def page() -> str:
    return (DOCS / "fusion.md").read_text()


def studies() -> list[str]:
    return [name for name in generator()["STUDIES"] if (DOCS / "data" / f"{name}.json").exists()]


def test_tables_and_figures_stand_where_their_generator_writes_them() -> None:
    assert generator()["page"](page()) == page(), (
        "in the environment (source scripts/env.sh) run `python docs/make_fusion.py`"
    )


def test_every_table_and_figure_of_every_study_has_its_place_once() -> None:
    places = [(kind, study, title) for _, kind, study, title, _, _ in generator()["PLACE"].findall(page())]
    assert len(set(places)) == len(places)
    assert {study for _, study, _ in places} == set(generator()["STUDIES"])
    for study in studies():
        data = json.loads((DOCS / "data" / f"{study}.json").read_text())
        made = {("table", study, title) for title in study_of(study).words(data["table"])}
        assert {place for place in places if place[:2] == ("table", study)} == made
        curves = DOCS / "data" / f"{study}_curves.json"
        if curves.exists():
            drawn = {("figure", study, name) for name in json.loads(curves.read_text())}
            assert {place for place in places if place[:2] == ("figure", study)} == drawn


def test_a_study_without_data_is_said_to_be_missing(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    functions = generator()["page"].__globals__
    monkeypatch.setitem(functions, "DATA", tmp_path)
    told = functions["page"](page())
    assert told.count("*Not measured yet: `python3 scripts/experiment.py ") == len(functions["PLACE"].findall(page()))
    assert "|---|" not in told[told.index("## The ladder") :]


def test_a_study_is_taken_without_the_places_of_the_machine_that_it_ran_on(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    functions = generator()["take"].__globals__
    monkeypatch.setitem(functions, "DATA", tmp_path / "data")
    (tmp_path / "data").mkdir()
    (tmp_path / "config.json").write_text('{"study": "ladder", "options": {}}')
    kept = {
        "table": [],
        "columns": {},
        "options": {"trees": 5},
        "git_revision": "1" * 40,
        "tasks": 3,
        "done": 3,
        "failed": {},
    }
    (tmp_path / "table.json").write_text(json.dumps({**kept, "out": str(tmp_path)}))
    (tmp_path / "curves.json").write_text("{}")
    functions["take"](tmp_path)
    assert json.loads((tmp_path / "data" / "ladder.json").read_text()) == kept
    assert (tmp_path / "data" / "ladder_curves.json").read_text() == "{}"


@pytest.mark.parametrize("study", studies())
def test_the_data_are_of_a_whole_study_and_name_no_place_of_a_machine(study: str) -> None:
    found = json.loads((DOCS / "data" / f"{study}.json").read_text())
    assert (found["done"], found["failed"]) == (found["tasks"], {})
    assert not re.search(r'"[^"]*(/tmp|/home|/root|/work)', json.dumps(found))
