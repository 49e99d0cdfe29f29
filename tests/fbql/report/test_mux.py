"""The page of a run of a mux: what was decided, counted from the recording, and nothing that a name could smuggle in."""

from __future__ import annotations

import base64
import csv
import json
import re
from html import unescape
from io import StringIO
from pathlib import Path

import pytest
from commands import report
from fbql.report.mux import read_episodes, write_mux_page
from fbql_common.core.recording_names import EPISODES
from fbql_recording.run import open_run
from rail import SOURCES, Rail, Result
from recorded_rail import record_rail


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run that learned. Not to be changed."""
    return record_rail(tmp_path_factory.mktemp("mux") / "<run> & co", 12)


def test_its_episodes_are_those_of_the_run(recorded: Path) -> None:
    with (recorded / EPISODES).open() as file:
        rows = list(csv.DictReader(file))
    episodes = read_episodes(open_run(recorded))
    assert [(each.index, each.phase, each.outcome, each.steps, each.return_) for each in episodes] == [
        (int(row["index"]), row["phase"], row["outcome"], int(row["steps"]), float(row["return"])) for row in rows
    ]
    assert {name for each in episodes for name in each.drove} == set(SOURCES), (
        "both sources drive while they are learned"
    )


def test_it_counts_as_the_summary_does_whatever_word_an_outcome_brings(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Rail, "step", lambda _rail, _speed: Result(1.0, truncated=True, outcome="success"))
    path = record_rail(tmp_path / "run", 3, guided=1)
    summary = json.loads((path / "summary.json").read_text())
    assert (summary["episodes"], summary["successes"], summary["timeouts"]) == (2, 0, 2)
    out = StringIO()
    episodes = write_mux_page(open_run(path), out)
    assert [(each.phase, each.outcome) for each in episodes] == [("guided", "timeout"), *[("learning", "timeout")] * 2]
    for tile in ("<b>2</b> episodes", "and 1 guided, not counted", "<b>0</b> successes", "<b>2</b> timeouts"):
        assert tile in out.getvalue()


def test_the_command_writes_a_page_that_tells_how_it_went(
    recorded: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "page.html"
    assert report([str(recorded), "--out", str(out), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    summary = json.loads((recorded / "summary.json").read_text())
    assert (found["episodes"], found["steps"], found["complete"]) == (12, summary["steps"], True)
    page = out.read_text()
    for name in ("successes", "failures", "timeouts"):
        assert f"<b>{summary[name]}</b> {name}" in page
    assert summary["digest"] in page
    text = unescape(re.sub("<[^>]*>", " ", page))
    assert text.count("● success") == summary["successes"] + (summary["successes"] > 0), (
        "each episode, and the head of who drove"
    )
    for name in SOURCES:
        assert name in text


def test_it_makes_no_request_runs_no_script_and_takes_names_as_text(recorded: Path) -> None:
    out = StringIO()
    picture = b"a picture"
    write_mux_page(open_run(recorded), out, picture=picture)
    page = out.getvalue()
    assert "<h1>&lt;run&gt; &amp; co</h1>" in page
    assert "<script" not in page
    assert "default-src 'none'; img-src data:" in page
    assert f'src="data:image/png;base64,{base64.b64encode(picture).decode()}"' in page
    assert re.findall(r'(?:src|href)="(?!data:)[^"]*"', page) == []
