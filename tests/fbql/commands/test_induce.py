"""`induce.py`: every method, the page about the tree, and what is refused."""

from __future__ import annotations

import json
import re
import shlex
import signal
import subprocess
import sys
from html.parser import HTMLParser
from math import inf, nan
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from commands import induce, tree
from fbql.commands.bringup import parser as bringup_parser
from fbql.match.options import match_from
from fbql.report.induction import Induction, induction_page
from fbql_behaviors.core.explanation import rules
from fbql_behaviors.core.patterns import patterns_from_rows
from fbql_behaviors.core.quantizer import LEVEL_RAD_S
from fbql_behaviors.storage import load_tree
from patience import PATIENCE_S

FEW = ("--patterns", "200")


def induced(capsys: pytest.CaptureFixture[str], tmp_path: Path, *words: str) -> dict[str, Any]:
    assert induce(["ball_seeking", *FEW, "--json", "--out", str(tmp_path / "tree.json"), *words]) == 0
    out = capsys.readouterr().out
    assert out.count("\n") == 1
    return json.loads(out)


def refused(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    try:
        code = induce(list(words))
    except SystemExit as end:  # the parser's
        code = end.code
    said = capsys.readouterr()
    assert code == 2
    assert said.out == ""
    line = said.err.splitlines()[-1]
    assert line.startswith("induce.py: ")
    return line


def next_commands(said: str) -> list[list[str]]:
    """The commands that are said to come next, split as a shell would."""
    lines = said.partition("Next:\n")[2].splitlines()
    return [shlex.split(line)[1:] for line in lines if line.startswith("  python3 ")]


def test_what_to_type_next_is_said_and_can_be_typed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "my trees" / "ball_seeking.json"
    assert induce(["ball_seeking", *FEW, "--out", str(path)]) == 0
    reading, playing = next_commands(capsys.readouterr().err)
    assert (reading[0], playing[0]) == ("scripts/tree.py", "scripts/bringup.py")
    assert tree(reading[1:]) == 0
    assert "leaf   0: " in capsys.readouterr().out
    assert match_from(bringup_parser("bringup").parse_args(playing[1:])).behaviors["ball_seeking"] == path


def test_a_tree_that_no_team_finds_is_only_read_next(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert induce(["ball_seeking", *FEW, "--out", str(tmp_path / "other.json")]) == 0
    assert [command[0] for command in next_commands(capsys.readouterr().err)] == ["scripts/tree.py"]
    assert induce(["ball_seeking", *FEW, "--out", str(tmp_path / "other.json"), "--json"]) == 0
    assert "Next" not in capsys.readouterr().err


class Page(HTMLParser):
    """What a page is made of."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.foreign: list[str] = []
        self.texts: list[str] = []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag not in ("meta", "br"):
            self.open.append(tag)
        self.foreign += [f"{tag} {name}" for name, _ in attrs if name in ("src", "href", "action")]
        if tag in ("script", "link", "iframe", "img"):
            self.foreign.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.texts.append(data)


@pytest.mark.parametrize("words", [("--method", "rl"), ("--method", "dp"), ("--objective", "printed"), ()])
def test_every_method_prints_the_agreed_keys(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, words: tuple[str, ...]
) -> None:
    result = induced(capsys, tmp_path, *words)
    assert {"leaves", "rmse_levels", "rmse_rad_s", "root_value", "seconds", "path"} <= set(result)
    tree = load_tree(tmp_path / "tree.json")
    assert (result["leaves"], result["sha256"]) == (tree.leaf_count, tree.hash)
    assert result["rmse_rad_s"] == pytest.approx(result["rmse_levels"] * LEVEL_RAD_S)
    assert 0.0 < result["rmse_levels"] < 5.0
    assert result["report"] is None


def test_cart_has_the_leaves_it_is_told_or_as_many_as_cross_validation_chooses(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    pytest.importorskip("sklearn")
    told = induced(capsys, tmp_path, "--method", "cart", "--leaves", "9")
    assert told["leaves"] == 9
    assert load_tree(tmp_path / "tree.json").origin["method"] == "cart"
    chosen = induced(capsys, tmp_path, "--method", "cart", "--report")
    assert "Choice of size" in (tmp_path / "tree.html").read_text()
    assert 2 <= chosen["leaves"] <= 64
    best = induced(capsys, tmp_path, "--method", "dp")
    assert told["root_value"] < best["root_value"]


def test_without_scikit_learn_cart_is_refused_before_anything_is_done(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "sklearn", None)
    line = refused(capsys, "ball_seeking", "--method", "cart")
    assert "scikit-learn" in line and "pip install -r requirements/study.txt" in line


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (("dancing",), "unknown behavior 'dancing'"),
        (("ball_seeking", "--leaves", "9"), "leaves applies only to method cart"),
        (("ball_seeking", "--method", "dp", "--curve", "x"), "--curve needs --method rl"),
        (("ball_seeking", "--method", "magic"), "invalid choice: 'magic'"),
        (("ball_seeking", "--demos", "missing"), "missing: "),
        (("ball_seeking", "--observation", "missing.py"), "missing.py: no such file"),
    ],
)
def test_bad_input_is_one_line(capsys: pytest.CaptureFixture[str], words: tuple[str, ...], reason: str) -> None:
    assert reason in refused(capsys, *words)


@pytest.fixture(scope="module")
def page_and_tree(tmp_path_factory: pytest.TempPathFactory) -> tuple[str, Path]:
    place = tmp_path_factory.mktemp("report")
    words = ["ball_seeking", *FEW, "--trials", "30", "--out", str(place / "tree.json")]
    assert induce([*words, "--report", str(place / "page.html")]) == 0
    assert induce([*words, "--report"]) == 0
    assert (place / "tree.html").read_bytes() == (place / "page.html").read_bytes()
    return (place / "page.html").read_text(), place / "tree.json"


def test_the_page_stands_alone_and_is_sound(page_and_tree: tuple[str, Path]) -> None:
    text, _ = page_and_tree
    page = Page(text)
    assert page.open == []
    assert page.foreign == []
    assert not re.search(r"url\(|@import|https?://(?!www\.w3\.org/2000/svg)", text)


def test_the_page_tells_of_data_parameters_course_error_and_every_leaf(page_and_tree: tuple[str, Path]) -> None:
    text, path = page_and_tree
    tree = load_tree(path)
    said = Page(text).texts
    assert tree.hash in said
    assert str(tree.origin["patterns_sha256"]) in said
    for name in ("trials", "split_cost", "min_patterns", "objective", "seed"):
        assert name in said
    assert "200" in said and any("demonstrations" in each for each in said)
    assert any("held-out error" in each for each in said)
    for rule in rules(tree):
        assert rule.where in said
        assert f"leaf {rule.leaf_id}: {rule.sentence}" in said


def test_the_pages_figures_are_a_partition_what_was_shown_and_a_curve_of_every_trial_beside_the_optimum(
    page_and_tree: tuple[str, Path],
) -> None:
    text, path = page_and_tree
    partition, _coverage, curve = [
        ElementTree.fromstring(each) for each in re.findall(r"<svg.*?</svg>", text, re.DOTALL)
    ]
    svg = "{http://www.w3.org/2000/svg}"
    regions = [each for each in partition.iter(f"{svg}rect") if each.find(f"{svg}title") is not None]
    assert len(regions) == load_tree(path).leaf_count
    assert len(curve.findall(f"{svg}polyline")[0].attrib["points"].split()) == 30
    assert [each.text for each in curve.iter(f"{svg}text")][-1] == "optimum"


def test_the_page_holds_the_tree_file(page_and_tree: tuple[str, Path]) -> None:
    text, path = page_and_tree
    assert [each for each in Page(text).texts if each.lstrip().startswith("{")] == [path.read_text()]


def test_the_learning_curve_is_recorded_trial_by_trial(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    file = tmp_path / "new" / "curve.csv"
    result = induced(capsys, tmp_path, "--trials", "30", "--curve", str(file))
    head, *rows = [line.split(",") for line in file.read_text().splitlines()]
    assert head == ["trial", "root_value_nat"]
    assert [row[0] for row in rows] == [str(trial) for trial in range(1, 31)]
    assert float(rows[-1][1]) == result["root_value"] != float(rows[0][1])


def test_a_curve_that_cannot_be_written_is_said(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    words = ("ball_seeking", *FEW, "--out", str(tmp_path / "tree.json"), "--curve", str(tmp_path))
    assert f"{tmp_path}: " in refused(capsys, *words)


def test_a_value_that_diverged_is_said_and_ends_the_curve(page_and_tree: tuple[str, Path]) -> None:
    tree = load_tree(page_and_tree[1])
    patterns = patterns_from_rows(tree.features, [(0.5, 0.1), (1.0, -0.1)], [420, 840])
    about = ("hand-made", "rl", "printed", inf, 0.25, 0.5, None, 1.0)
    text = induction_page(Induction(tree, patterns, 1, *about, curve=[0.1, 0.2, inf, nan], tried={}))
    assert Page(text).open == []
    assert {"diverged", "n/a"} <= set(Page(text).texts)
    assert "the tree is worth 0.250 nat, the best one 0.500 nat" in text
    assert len(re.findall(r'points="([^"]*)"', text)[0].split()) == 2


def test_an_interrupt_ends_the_trials_in_one_line_and_leaves_what_was_there(tmp_path: Path) -> None:
    """Fault 60. The warning comes right before the trials begin."""
    path = tmp_path / "tree.json"
    path.write_text("older")
    words = ["ball_seeking", "--patterns", "20", "--trials", "1000000", "--out", str(path)]
    command = [sys.executable, "-c", f"from fbql.cli.app import run; raise SystemExit(run('induce', {words}))"]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        assert any("warning: " in line for line in process.stderr)
        process.send_signal(signal.SIGINT)
        rest = process.communicate(timeout=PATIENCE_S)[1]
    assert process.returncode == 130
    assert [line for line in rest.splitlines() if "warning: " not in line] == ["fbql induce: interrupted"]
    assert [each.name for each in tmp_path.iterdir()] == ["tree.json"]
    assert path.read_text() == "older"


def test_a_page_that_cannot_be_written_is_said(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    (tmp_path / "there").mkdir()
    words = ["ball_seeking", *FEW, "--out", str(tmp_path / "tree.json"), "--report", str(tmp_path / "there")]
    assert induce(words) == 2
    assert (
        f"induce.py: {tmp_path}/there: cannot be written (Is a directory); choose another place\n"
        in capsys.readouterr().err
    )


def test_a_tree_that_cannot_be_written_is_refused_by_the_name_that_was_given(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    (tmp_path / "file").touch()
    for path, reason in ((tmp_path / "file" / "x.json", "Not a directory"), (tmp_path, "Is a directory")):
        line = refused(capsys, "ball_seeking", *FEW, "--out", str(path))
        assert line == f"induce.py: {path}: cannot be written ({reason}); choose another place"


def test_a_tree_that_is_replaced_is_said(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    words = ["ball_seeking", *FEW, "--out", str(tmp_path / "tree.json")]
    assert induce(words) == 0
    assert "replaced the existing" not in capsys.readouterr().err
    assert induce(words) == 0
    assert f"{tmp_path}/tree.json: replaced the existing tree\n" in capsys.readouterr().err


def test_a_tree_of_one_leaf_is_said_and_what_to_do(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    words = ["ball_seeking", *FEW, "--split-cost", "-5", "--out", str(tmp_path / "tree.json")]
    assert induce(words) == 0
    out, err = capsys.readouterr()
    assert out.startswith("1 leaf from 200 patterns")
    assert "induce.py: warning: the tree is a single leaf" in err and "record more demonstrations" in err


@pytest.mark.parametrize(
    ("words", "unused"),
    [
        (("--method", "dp", "--trials", "9", "--seed", "3", "--min-patterns", "3"), ["--trials", "--seed"]),
        (("--method", "cart", "--leaves", "4", "--optimism", "0.2", "--max-entropy", "0.1", "--split-cost", "-0.02"),
         ["--max-entropy", "--optimism"]),
        (("--method", "rl", "--trials", "9", "--seed", "3", "--max-entropy", "0.1"), []),
    ],
)  # fmt: skip
def test_options_without_effect_on_a_method_are_reported_in_a_line_each(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, words: tuple[str, ...], unused: list[str]
) -> None:
    if "cart" in words:
        pytest.importorskip("sklearn", reason="CART is scikit-learn's, which is in requirements/study.txt")
    assert induce(["ball_seeking", *FEW, "--json", "--out", str(tmp_path / "tree.json"), *words]) == 0
    said = [line for line in capsys.readouterr().err.splitlines() if "has no effect" in line]
    assert said == [f"induce.py: {option} has no effect with --method {words[1]}" for option in unused]
