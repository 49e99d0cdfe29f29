"""docs/results, and the small tables of docs/fusion.md and docs/trees.md, are what docs/make_results.py writes from docs/data."""

from __future__ import annotations

import json
import re
import runpy
from dataclasses import asdict
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from fbql_sim.core.scripted_law import TUNED
from fbql_studies.runner.study import STUDIES, study_of
from file_limit import largest_file
from places import ROOT

DOCS = ROOT / "docs"
MEASURED = [study for study in STUDIES if (DOCS / "data" / f"{study}.json").exists()]
MOST_ROWS = 8
"""Of a table between prose; the whole table is on the page of results."""


@cache
def generator() -> dict[str, Any]:
    return runpy.run_path(str(DOCS / "make_results.py"))


def test_every_page_is_what_the_generator_writes() -> None:
    pages = generator()["pages"]()
    assert {path.name for path in pages if path.parent.name == "results"} == {
        path.name for path in (DOCS / "results").iterdir()
    }
    for path, text in pages.items():
        assert path.read_text() == text, "in the environment (source scripts/env.sh) run `python docs/make_results.py`"


@pytest.mark.parametrize("study", MEASURED)
def test_a_page_of_results_has_every_table_and_figure_of_its_study(study: str) -> None:
    text = (DOCS / "results" / f"{study}.md").read_text()
    data = json.loads((DOCS / "data" / f"{study}.json").read_text())
    for title in study_of(study).words(data["table"]):
        assert f"\n## {title[:1].upper()}{title[1:]}\n" in text
    curves = DOCS / "data" / f"{study}_curves.json"
    if curves.exists():
        assert set(study_of(study).CAPTIONS) == {f"fusion_{name}" for name in json.loads(curves.read_text())}
    for file in re.findall(r"\]\((\.\.?/[^)#]+)", text):
        assert (DOCS / "results" / file).exists(), file
    assert data["git_revision"] in text


def test_the_page_of_a_study_that_was_not_run_says_so() -> None:
    for study in set(STUDIES) - set(MEASURED):
        text = (DOCS / "results" / f"{study}.md").read_text()
        assert text.endswith(f"*Not measured yet: `python3 scripts/experiment.py {study}`.*\n")


@pytest.mark.parametrize("name", ["fusion.md", "trees.md"])
def test_a_table_between_prose_has_few_rows_and_a_link_to_all_of_them(name: str) -> None:
    text = (DOCS / name).read_text()
    blocks = re.findall(r"<!-- table: (\w+): [^|>]+.*?-->\n(.*?)<!-- end -->", text, re.DOTALL)
    assert blocks
    for _, block in blocks:
        assert len([line for line in block.splitlines() if line.startswith("|")]) - 2 <= MOST_ROWS
    for study, anchor in re.findall(r"\(results/(\w+)\.md#([^)]+)\)", text):
        heads = re.findall(r"^## (.*)$", (DOCS / "results" / f"{study}.md").read_text(), re.MULTILINE)
        assert anchor in {generator()["_anchor"](head) for head in heads}


def test_a_study_without_data_is_said_to_be_missing(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    functions = generator()["pages"].__globals__
    monkeypatch.setitem(functions, "DATA", tmp_path)
    for path, text in functions["pages"]().items():
        if path.name != "README.md":
            assert "*Not measured yet: `python3 scripts/experiment.py " in text
    assert "| ---" not in functions["results_page"]("ladder")


def test_a_study_is_taken_without_the_places_of_the_machine_that_it_ran_on(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    functions = generator()["take"].__globals__
    for name in ("DATA", "IMAGES"):
        (tmp_path / name).mkdir()
        monkeypatch.setitem(functions, name, tmp_path / name)
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
    (tmp_path / "trees_play.svg").write_text("<svg/>")
    functions["take"](tmp_path)
    assert json.loads((tmp_path / "DATA" / "ladder.json").read_text()) == kept
    assert (tmp_path / "IMAGES" / "trees_play.svg").exists(), "without the numbers behind them, figures are copied"
    (tmp_path / "curves.json").write_text("{}")
    functions["take"](tmp_path)
    assert (tmp_path / "DATA" / "ladder_curves.json").read_text() == "{}"


def measured(cost: float, revision: str = "1" * 40) -> dict[str, Any]:
    table = [{"method": "subsumption, tuned"}, {"method": "fbql", "cost_per_goal": cost}]
    kept = {"table": table, "columns": {}, "git_revision": revision, "tasks": 1, "done": 1, "failed": {}}
    return {**kept, "options": {"first_trees": 1001, "first_seed": 1000}}


def test_a_study_that_is_measured_again_on_the_same_sets_says_how_often(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    functions = generator()["take"].__globals__
    for name in ("DATA", "IMAGES"):
        (tmp_path / name).mkdir()
        monkeypatch.setitem(functions, name, tmp_path / name)

    def take(study: str, found: dict[str, Any]) -> str:
        (tmp_path / "config.json").write_text(json.dumps({"study": study}))
        (tmp_path / "table.json").write_text(json.dumps(found))
        functions["take"](tmp_path)
        return functions["how_often"](study)

    once = take("ladder", measured(400.0))
    assert once == (
        "Measured once on these tree sets and run seeds (from demonstration seed 1001 and run seed 1000 on)."
    )
    assert take("ladder", measured(400.0)) == once, "the same table was only written again"
    again = take("ladder", measured(300.0))
    assert again.startswith("Measured twice on these tree sets and run seeds")
    assert "with fbql's cost/goal at 400, 300. What was changed in between may fit them." in again
    assert "; `ladder` was measured on them twice. What was changed" in take("paper", measured(700.0))
    fresh = {**measured(310.0), "options": {"first_trees": 1031, "first_seed": 40_000}}
    assert take("ladder", fresh).startswith("Measured once on these")
    assert functions["how_often"]("sensitivity") == ""
    assert again != once
    monkeypatch.setitem(functions, "_tables", lambda _study, _data: {})
    assert functions["results_page"]("ladder").count("Measured once on these tree sets") == 1


@pytest.mark.parametrize("study", MEASURED)
def test_the_latest_measurement_of_a_study_is_the_one_that_its_page_shows(study: str) -> None:
    data = json.loads((DOCS / "data" / f"{study}.json").read_text())
    listed = json.loads((DOCS / "data" / "measurements.json").read_text())
    last = [each for each in listed if each["study"] == study][-1]
    assert last["git_revision"] == data["git_revision"]
    fbql = next((row for row in data["table"] if row.get("method") == "fbql"), {})
    assert last["fbql_cost_per_goal"] == fbql.get("cost_per_goal")


def test_a_full_disk_leaves_what_was_there(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    functions = generator()["take"].__globals__
    monkeypatch.setitem(functions, "DATA", tmp_path)
    (tmp_path / "config.json").write_text('{"study": "ladder"}')
    (tmp_path / "table.json").write_text(json.dumps(dict.fromkeys(functions["KEPT"], "x" * 1000)))
    (tmp_path / "ladder.json").write_text("as it was")
    with largest_file(500), pytest.raises(OSError, match="File too large"):
        functions["take"](tmp_path)
    assert (tmp_path / "ladder.json").read_text() == "as it was"


@pytest.mark.parametrize("study", MEASURED)
def test_the_data_are_of_a_whole_study_and_name_no_place_of_a_machine(study: str) -> None:
    found = json.loads((DOCS / "data" / f"{study}.json").read_text())
    assert (found["done"], found["failed"]) == (found["tasks"], {})
    assert not re.search(r'"[^"]*(/tmp|/home|/root|/work)', json.dumps(found))


def test_the_tuned_law_is_what_the_best_search_of_its_study_found() -> None:
    """The best on the episodes by which searches are compared, not on those of the evaluation, which confirm it."""
    rows = json.loads((DOCS / "data" / "law.json").read_text())["table"]
    laws = [row for row in rows if "law" in row]
    best = min((k for k, row in enumerate(laws) if row["tries"]), key=lambda k: laws[k]["choosing_cost"])
    assert {row["constant"]: row["values"][best] for row in rows if "constant" in row} == asdict(TUNED)
