"""Steps and episodes as tables, read back with the readers of others: csv, pandas, pyarrow."""

from __future__ import annotations

import csv
import math
import re
import sys
from pathlib import Path

import pytest
from fbql_common.core.errors import BadInput
from fbql_recording.run import open_run
from fbql_recording.tables import episodes_frame, steps_frame, write_episodes, write_steps
from places import ROOT
from recorded_match import record_match

OPTIONAL = "it is in requirements/study.txt"


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run that learned; of its first steps a behavior is missing. Not to be changed."""

    def hear(world, outputs):
        gone = world.episode == 0 and world.step < 5
        return [None if gone and i == 1 else output for i, output in enumerate(outputs)]

    directory = tmp_path_factory.mktemp("recorded") / "run"
    return record_match(directory, hear=hear, max_steps=100, controller="fbql_literal", guided=1)


def test_a_csv_reads_back_to_the_last_bit(recorded, tmp_path):
    run = open_run(recorded)
    path = tmp_path / "steps.csv"
    count = write_steps(run, path)
    columns = run.arrays()
    with path.open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == count == len(columns["step"])
    assert [float(row["ball_vx_m_s"]) for row in rows] == columns["ball_vx_m_s"].tolist()
    assert [float(row["weights.approaching"]) for row in rows] == columns["weights"][:, 2].tolist()
    assert [row["truncated"] == "True" for row in rows] == columns["truncated"].tolist()
    assert [row["reference_left_rad_s.wall_avoiding"] == "" for row in rows[:6]] == [True] * 5 + [False]
    assert rows[5]["observation.wall_avoiding.wall_distance"] == repr(float(columns["observation.wall_avoiding"][5, 0]))


def test_what_is_not_available_is_an_empty_field_and_never_zero(tmp_path):
    run = open_run(record_match(tmp_path / "run", max_steps=20, close=False))
    write_episodes(run, tmp_path / "episodes.csv")
    with (tmp_path / "episodes.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["index"] for row in rows] == ["0", "1"]
    run.attachments.clear()
    (run.directory / "episodes.csv").unlink()
    write_episodes(run, tmp_path / "again.csv")
    with (tmp_path / "again.csv").open(newline="") as file:
        assert {row["seed"] for row in csv.DictReader(file)} == {""}


def test_a_parquet_file_holds_the_columns(recorded, tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet", reason=OPTIONAL)
    run = open_run(recorded)
    write_steps(run, tmp_path / "steps.parquet")
    table = parquet.read_table(tmp_path / "steps.parquet")
    columns = run.arrays()
    assert table.column("robot_x_m").to_pylist() == columns["robot_x_m"].tolist()
    assert table.column("leaf_id.ball_seeking").to_pylist() == columns["leaf_id"][:, 0].tolist()
    assert math.isnan(table.column("observation.wall_avoiding.wall_distance")[0].as_py())
    assert write_episodes(run, tmp_path / "episodes.parquet") == len(run.episodes())
    assert parquet.read_table(tmp_path / "episodes.parquet").column("outcome").to_pylist() == [
        episode.outcome for episode in run.episodes()
    ]


def test_a_data_frame_has_a_row_a_step_and_a_row_an_episode(recorded):
    pytest.importorskip("pandas", reason=OPTIONAL)
    run = open_run(recorded)
    frame = steps_frame(run)
    assert list(frame["step"]) == [step.step for step in run.steps()]
    assert frame["q.ball_seeking"].tolist()[-1] == list(run.steps())[-1].decision.q[0]
    episodes = episodes_frame(run)
    assert list(episodes["return"]) == [episode.return_ for episode in run.episodes()]
    assert list(episodes["phase"]) == ["guided", "learning", "learning"]


def test_another_kind_of_file_or_a_missing_package_is_one_line(recorded, tmp_path, monkeypatch):
    run = open_run(recorded)
    with pytest.raises(BadInput, match=r"write \.csv or \.parquet"):
        write_steps(run, tmp_path / "steps.xlsx")
    with pytest.raises(BadInput, match="can't be written"):
        write_steps(run, tmp_path / "nowhere" / "steps.csv")
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(BadInput, match="pandas is not installed; `pip install pandas`"):
        steps_frame(run)


def test_the_examples_of_the_documents_run(recorded, tmp_path, monkeypatch, capsys):
    """docs/recordings.md and the package's README: they read, write and recover, on a run in the place that they name."""
    (tmp_path / "runs").mkdir()
    (tmp_path / "runs" / "picture").symlink_to(recorded)
    monkeypatch.chdir(tmp_path)
    documents = [ROOT / "docs" / "recordings.md", ROOT / "ros2_ws" / "src" / "fbql_recording" / "README.md"]
    examples = [
        code for path in documents for code in re.findall(r"^```python\n(.*?)^```", path.read_text(), re.M | re.S)
    ]
    assert len(examples) == 5
    for example in examples:
        exec(compile(example, "example", "exec"), {})
    said = capsys.readouterr().out
    assert "('ball_seeking', 'wall_avoiding', 'approaching')" in said
    assert said.endswith(f"{sum(open_run(recorded).counts.values())} 0 {{}} True\n")  # what the recovery tells
    assert (tmp_path / "steps.csv").stat().st_size > 1000
    assert open_run(tmp_path / "recording").counts == {"/wheel_command": 1}
    assert open_run(tmp_path / "runs" / "picture_recovered").is_complete
