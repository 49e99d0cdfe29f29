"""`report.py --figures`: figures in the manner of the paper's, the numbers beside them, episodes and steps as tables."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from xml.etree import ElementTree

import pytest
from commands import report as main
from fbql_recording.core.episodes import Episode
from fbql_recording.run import open_run
from recorded_match import record_match

pytest.importorskip("matplotlib", reason="it is in requirements/study.txt")
pytest.importorskip("pyarrow", reason="it is in requirements/study.txt")

from fbql.report.figures import course_of, write_figures

FIGURES = {
    f"success_{name}.{ending}" for name in ("steps", "collisions", "failures", "rate") for ending in ("pdf", "svg")
}
TABLES = {"successes.csv", "episodes.csv", "episodes.parquet", "steps.csv", "steps.parquet"}


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Subsumption, which scores, and now and then runs out of time. Not to be changed."""
    return record_match(tmp_path_factory.mktemp("recorded") / "run", episodes=6, max_steps=450)


def rows_of(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def test_figures_and_tables_stand_beside_the_page(recorded, tmp_path, capsys):
    import pyarrow.parquet

    assert main([str(recorded), "--out", str(tmp_path / "page.html"), "--figures", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    directory = tmp_path / "page-figures"
    assert (
        {Path(file).name for file in found["files"]} == {file.name for file in directory.iterdir()} == FIGURES | TABLES
    )
    for file in directory.glob("*.svg"):
        assert ElementTree.parse(file).getroot().tag.endswith("svg")
    for file in directory.glob("*.pdf"):
        assert file.read_bytes().startswith(b"%PDF")
    run = open_run(recorded)
    episodes = run.episodes()
    goals = [episode for episode in episodes if episode.outcome == "goal"]
    assert [row["steps"] for row in rows_of(directory / "successes.csv")] == [str(each.steps) for each in goals]
    assert [row["seed"] for row in rows_of(directory / "episodes.csv")] == [str(each.seed) for each in episodes]
    steps = pyarrow.parquet.read_table(directory / "steps.parquet")
    assert steps.num_rows == found["steps"] == len(rows_of(directory / "steps.csv"))
    assert steps["weights.approaching"].to_pylist() == run.arrays()["weights"][:, 2].tolist()


def episode(index: int, outcome: str | None, steps: int = 10, phase: str = "learning", begun: int = 0) -> Episode:
    return Episode(
        index, 0, phase=phase, outcome=outcome, steps=steps, collisions_begun=begun, collision_steps=3 * begun
    )


@pytest.fixture(scope="module")
def episodes() -> list[Episode]:
    return [
        episode(0, "goal", 99, phase="guided", begun=9),
        episode(1, "timeout", 100),
        episode(2, "own_goal", 20),
        episode(3, "goal", 30, begun=1),
        episode(4, "goal", 40, begun=2),
        *(episode(number, "goal", 50) for number in range(5, 9)),
        episode(9, None, 7),
    ]


@pytest.fixture(scope="module")
def drawn(episodes, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Their figures. Not to be changed."""
    place = tmp_path_factory.mktemp("drawn")
    write_figures(episodes, "a $title", place)
    return place


def test_a_success_counts_what_it_took_since_the_one_before(episodes, drawn):
    assert len(course_of(episodes)) == 8
    first, second, _, _, fifth, sixth = rows_of(drawn / "successes.csv")
    assert (first["failures"], first["steps"], first["all_steps"], first["collisions_begun"]) == ("2", "30", "150", "1")
    assert (second["failures"], second["steps"], second["all_steps"], second["contact_steps"]) == ("0", "40", "40", "6")
    assert second["mean_failures"] == second["mean_success_rate"] == "", "no five successes yet"
    assert (float(fifth["mean_failures"]), float(fifth["mean_success_rate"])) == (2 / 5, 5 / 7)
    assert (float(sixth["mean_failures"]), float(sixth["mean_steps"])) == (0.0, 48.0)


def test_without_a_goal_the_figures_say_so(tmp_path):
    write_figures([episode(0, "timeout")], "none", tmp_path)
    assert "n/a: no goal" in (tmp_path / "success_steps.svg").read_text()
    assert rows_of(tmp_path / "successes.csv") == []


def test_the_same_episodes_give_the_same_files(episodes, drawn, tmp_path):
    files = write_figures(episodes, "a $title", tmp_path)
    assert {file.name: file.read_bytes() for file in files} == {
        file.name: file.read_bytes() for file in drawn.iterdir()
    }


def test_figures_that_are_there_are_only_replaced_by_force(recorded, tmp_path, capsys):
    (tmp_path / "page-figures").mkdir()
    assert main([str(recorded), "--out", str(tmp_path / "page.html"), "--figures"]) == 2
    assert "page-figures exists; --force replaces it" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == [tmp_path / "page-figures"]
