"""`report.py`: the page tells what was recorded, whoever made the recording, and is there whole or not at all."""

from __future__ import annotations

import base64
import json
import os
import re
import shutil
import signal
from html.parser import HTMLParser
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from commands import report as main
from fbql.report.contents import UNIT, Contents, block_columns
from fbql.report.page import tiles
from fbql.report.texts import CONTROLLERS as EXPLAINED
from fbql.report.texts import FEATURES, json_for_html, value_text
from fbql_behaviors.core.explanation import rules
from fbql_behaviors.storage import load_tree
from fbql_fusion.core.controllers.parameters import CONTROLLERS
from fbql_recording.core.packing import FLOAT32, Packing, unpack
from fbql_recording.run import open_run
from hostile_run import BEHAVIOR, HOSTILE, hostile_run
from recorded_match import TREES, record_match

LEARNING = {"controller": "fbql_literal", "guided": 1, "tie_rule": "first"}
BEHAVIORS = ("ball_seeking", "wall_avoiding", "approaching")


@pytest.fixture(scope="module")
def learned(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run that learned, of more than one block of steps. Not to be changed."""
    return record_match(tmp_path_factory.mktemp("learned") / "run", max_steps=2200, **LEARNING)


@pytest.fixture(scope="module")
def page(learned: Path, tmp_path_factory: pytest.TempPathFactory) -> Page:
    """Its page."""
    return Page.of(learned, tmp_path_factory.mktemp("page") / "page.html")


@pytest.fixture
def run(learned: Path, tmp_path: Path) -> Path:
    """A copy of the run, to be changed."""
    return Path(shutil.copytree(learned, tmp_path / "run"))


class Page(HTMLParser):
    """A page, taken apart as a browser does."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.texts: dict[str, list[str]] = {}
        """What stands in each kind of element, entities resolved."""
        self._open = ""
        self.source = path.read_text(encoding="utf-8")
        self.feed(self.source)
        scripts = [attributes for name, attributes in self.elements if name == "script"]
        self.data: dict[str, Any] = {}
        self.blocks: list[bytes] = []
        for attributes, text in zip(scripts, self.texts["script"], strict=True):
            if attributes.get("id") == "data":
                self.data = json.loads(text)
            elif attributes.get("class") == "block":
                self.blocks.append(base64.b64decode(text))

    @staticmethod
    def of(run: Path, out: Path, *options: str, code: int = 0) -> Page:
        assert main([str(run), "--out", str(out), *options]) == code
        return Page(out)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))
        self._open = tag
        if tag == "script":
            self.texts.setdefault("script", []).append("")

    def handle_data(self, data: str) -> None:
        if self._open == "script":
            self.texts["script"][-1] += data
        elif data.strip():
            self.texts.setdefault(self._open, []).append(data)

    def handle_endtag(self, tag: str) -> None:
        self._open = ""

    def column(self, name: str) -> np.ndarray[Any, Any]:
        """A column of all steps."""
        parts: list[Any] = []
        for (rows, packing), block in zip(self.data["blocks"], self.blocks, strict=True):
            packings = [Packing(*each) for each in self.data["packings"][packing]]
            found = unpack(block, packings, rows)
            parts.append(found.get(name, np.full(rows, np.nan)))
        return np.concatenate(parts)

    def unit(self, name: str) -> float:
        return next(unit for packings in self.data["packings"] for each, unit in packings if each == name)


# What the page tells


def test_every_column_of_the_recording_is_in_the_page(learned, page):
    assert len(page.blocks) > 1
    columns = open_run(learned).arrays()
    checked = 0
    for name, column in columns.items():
        if name == "stamp_ns":
            assert np.allclose(page.column("time_s"), column / 1e9, atol=UNIT / 2 * 1.0001, rtol=0)
            continue
        kind, _, behavior = name.partition(".")
        key = f"{kind}.{BEHAVIORS.index(behavior)}" if behavior else name
        parts = {key: column} if column.ndim == 1 else {f"{key}.{k}": column[:, k] for k in range(column.shape[1])}
        for part, expected in parts.items():
            unit = page.unit(part)
            expected = expected.astype(np.float32) if unit == FLOAT32 else expected.astype(np.float64)
            assert np.allclose(page.column(part), expected, atol=unit / 2 * 1.0001, rtol=0, equal_nan=True), part
            checked += 1
    assert checked > 50
    assert np.nanmax(page.column("q.0")) > 0.0 or np.nanmin(page.column("q.0")) < 0.0


def test_leaves_are_told_in_the_words_of_their_tree(learned, page):
    trees = [load_tree(TREES / f"{name}.json") for name in BEHAVIORS]
    step = 1234
    for k, tree in enumerate(trees):
        leaf = int(page.column(f"leaf_id.{k}")[step])
        rule = rules(tree)[leaf]
        words = page.data["trees"][int(page.column(f"tree.{k}")[step])]
        assert words["leaves"][leaf] == [rule.where, rule.what]
        assert words["features"][0][0] == tree.features[0].name
    assert open_run(learned).arrays()["leaf_id"][step].tolist() == [
        int(page.column(f"leaf_id.{k}")[step]) for k in range(3)
    ]


def test_every_controller_and_every_feature_of_a_shipped_tree_is_explained(page):
    assert set(CONTROLLERS) == set(EXPLAINED)
    for words in page.data["trees"]:
        for name, _, _, meaning in words["features"]:
            assert meaning == FEATURES[name]


def test_commands_are_told_in_words(page):
    words = page.data["commands"][int(page.column("command_words")[0])]
    left, right = page.column("command_left_rad_s")[0], page.column("command_right_rad_s")[0]
    assert left + right > 0 and "forwards" in words


def test_episodes_are_those_of_the_recording(learned, page):
    episodes = open_run(learned).episodes()
    assert [each["first"] for each in page.data["episodes"]] == [episode.first_step for episode in episodes]
    assert [each["phase"] for each in page.data["episodes"]] == ["guided", "learning", "learning"]
    rows = [text for text in page.texts["td"] if text == str(episodes[1].seed)]
    assert len(rows) == 1


def test_parameters_and_hashes_stand_in_the_page(learned, page):
    run = open_run(learned)
    for text in (
        "weight_gain",
        str(run.parameters["fusion"]["weight_gain"]),
        load_tree(TREES / "approaching.json").hash,
    ):
        assert text in page.source
    assert run.summary is not None and run.summary["digest"] in page.source


def test_the_page_takes_fewer_bytes_a_step_than_its_limit(page):
    # 15 MB for 100,000 steps
    assert sum(4 * len(block) / 3 for block in page.blocks) / page.data["steps"] < 100


# Without a network, and whoever made the recording


def test_the_page_asks_for_nothing_outside_of_itself(page):
    for name, attributes in page.elements:
        assert name not in ("img", "iframe", "object", "embed", "base")
        for attribute in ("src", "href", "action", "srcset", "data"):
            assert attributes.get(attribute) in (None, "data:,"), (name, attributes)
    assert not re.search(r"https?://|//[a-z]+\.[a-z]|@import|url\(", page.source)
    policy = next(attributes["content"] for _, attributes in page.elements if "http-equiv" in attributes)
    assert policy is not None and policy.startswith("default-src 'none'; img-src data:;")


def test_hostile_names_are_texts_and_nothing_else(page, tmp_path):
    hostile = Page.of(hostile_run(tmp_path / HOSTILE.replace("/", "")), tmp_path / "page.html")
    assert hostile.source.count("alert(") > 5  # it is all there ...
    allowed = {name for name, _ in page.elements} | {"div", "span"}
    assert {name for name, _ in hostile.elements} <= allowed | {"ol", "section", "ul", "li"}
    assert sum(name == "script" for name, _ in hostile.elements) == len(hostile.blocks) + 2
    for _, attributes in hostile.elements:
        assert not any(name.startswith("on") for name in attributes)
    assert hostile.data["behaviors"] == [BEHAVIOR.replace("\u202e", " ").replace("\t", " ")]
    assert hostile.data["controllers"] == [HOSTILE]
    assert hostile.data["trees"][0]["features"][0][0] == HOSTILE  # ... as texts


def test_one_failure_in_many_is_not_rounded_away() -> None:
    ends = ["goal"] * 199 + ["own_goal"]
    episodes = [SimpleNamespace(outcome=end, steps=9, collisions_begun=0, phase="learning") for end in ends]
    assert "99.5 % of the episodes" in tiles(cast("Contents", SimpleNamespace(episodes=episodes)))


def test_the_tiles_of_a_match_that_begins_count_from_nought() -> None:
    shown = tiles(cast("Contents", SimpleNamespace(episodes=[])))
    assert all(f"<b>0</b> {name}" in shown for name in ("episodes", "goals", "own goals", "timeouts", "collisions"))


def test_nothing_ends_a_script_from_inside():
    text = json_for_html({"a": "</script><!--<script>", "b": ["\u2028", "&lt;"]})
    assert not set("<>&\u2028") & set(text)
    assert json.loads(text) == {"a": "</script><!--<script>", "b": ["\u2028", "&lt;"]}


def test_a_value_that_nests_without_end_is_cut_off():
    nested: Any = "x"
    for _ in range(30):
        nested = [nested] * 30
    assert len(value_text(nested)) < 1_000_000
    assert value_text([0.1, None, True]) == "0.1, n/a, true"


# The command


def test_json_tells_path_bytes_steps_and_episodes(learned, tmp_path, capsys):
    out = tmp_path / "page.html"
    assert main([str(learned), "--out", str(out), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["path"], found["bytes"], found["episodes"]) == (str(out), out.stat().st_size, 3)
    assert found["steps"] == sum(1 for _ in open_run(learned).steps())


def test_the_same_recording_gives_the_same_page(run, tmp_path):
    first, second = tmp_path / "a.html", tmp_path / "b.html"
    for out in (first, second):
        assert main([str(run), "--out", str(out)]) == 0
    assert first.read_bytes() == second.read_bytes()


def test_the_title_is_the_name_of_the_run_also_from_inside_of_it(run, tmp_path, monkeypatch):
    monkeypatch.chdir(run)
    assert main([".", "--out", str(tmp_path / "here.html")]) == 0
    text = (tmp_path / "here.html").read_text(encoding="utf-8")
    assert f"<title>{run.name}: what happened and why</title>" in text
    assert "time limit" not in text, "an episode that ran out of time is a timeout, in every place"


def test_a_page_is_only_replaced_by_force(run, capsys):
    assert main([str(run)]) == 0
    before = (run / "report.html").read_bytes()
    (run / "report.html").write_text("mine")
    assert main([str(run)]) == 2
    assert "report.html exists; --force replaces it" in capsys.readouterr().err
    assert (run / "report.html").read_text() == "mine"
    assert main([str(run), "--force"]) == 0
    assert (run / "report.html").read_bytes() == before


def test_an_mcap_file_alone_has_its_page_beside_it(learned, tmp_path):
    alone = Path(shutil.copy(next(learned.glob("*.mcap")), tmp_path / "alone.mcap"))
    assert main([str(alone)]) == 0
    page = Page(tmp_path / "alone-report.html")
    assert page.data["steps"] == sum(1 for _ in open_run(alone).steps())


def test_an_incomplete_recording_is_told_and_exits_with_3(tmp_path, capsys):
    unfinished = record_match(tmp_path / "run", max_steps=300, close=False)
    page = Page.of(unfinished, tmp_path / "page.html", code=3)
    assert "This recording is incomplete" in page.texts["h2"][0]
    assert "cut off at byte" in capsys.readouterr().err
    assert main([str(unfinished), "--out", str(tmp_path / "again.html"), "--allow-incomplete"]) == 0


def test_damage_leaves_no_page_behind_unless_it_is_skipped(run, tmp_path, capsys):
    mcap = next(run.glob("*.mcap"))
    data = bytearray(mcap.read_bytes())
    data[len(data) // 2] ^= 1
    mcap.write_bytes(data)
    out = tmp_path / "pages" / "page.html"
    out.parent.mkdir()
    assert main([str(run), "--out", str(out)]) == 2
    error = capsys.readouterr().err
    assert "chunk" in error and error.count("\n") == 1
    assert list(out.parent.iterdir()) == []
    page = Page.of(run, out, "--skip-corrupt", code=3)
    assert 0 < page.data["steps"] < 6000
    assert "left out" in page.source


def test_a_signal_ends_it_and_leaves_nothing_behind(learned, tmp_path, capsys, monkeypatch):
    def signalled(contents, steps):
        os.kill(os.getpid(), signal.SIGINT)
        return block_columns(contents, steps)

    monkeypatch.setattr("fbql.report.contents.block_columns", signalled)
    assert main([str(learned), "--out", str(tmp_path / "page.html")]) == 1
    assert "ended by SIGINT; nothing was written" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["nothing.mcap", "run/nothing"])
def test_what_is_not_there_is_one_line_and_exit_code_2(name, tmp_path, capsys):
    assert main([str(tmp_path / name)]) == 2
    error = capsys.readouterr().err
    assert error.startswith("report.py: ") and "no such run" in error and error.count("\n") == 1


def test_a_place_that_can_not_be_written_is_exit_code_2(learned, tmp_path, capsys):
    assert main([str(learned), "--out", str(tmp_path / "nowhere" / "page.html")]) == 2
    assert "cannot be written" in capsys.readouterr().err
