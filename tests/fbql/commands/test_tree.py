"""`tree.py`: explain, export, check and import, and what is refused in one line with exit code 2."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from commands import tree as command
from fbql_behaviors.core.c_source import to_c
from fbql_behaviors.core.explanation import rules
from fbql_behaviors.core.observation import OBSERVATIONS
from fbql_behaviors.core.tree import Leaf
from fbql_behaviors.drawing.dot import to_dot
from fbql_behaviors.drawing.partition import partition_svg
from fbql_behaviors.storage import load_tree
from places import ROOT

SHIPPED = ROOT / "ros2_ws/src/fbql_behaviors/fbql_behaviors/trees"
BALL, WALL = SHIPPED / "ball_seeking.json", SHIPPED / "wall_avoiding.json"
ARRAYS = {
    "children_left": [1, -1, -1],
    "children_right": [2, -1, -1],
    "feature": [0, -2, -2],
    "threshold": [0.5, -2.0, -2.0],
    "value": [[0.0, 0.0], [1.0, 2.0], [3.0, 4.0]],
    "n_node_samples": [9, 4, 5],
}


def run(*words: object) -> int:
    try:
        return command([str(word) for word in words])
    except SystemExit as end:  # the parser's
        return int(end.code or 0)


def said(capsys: pytest.CaptureFixture[str], *words: object) -> str:
    assert run(*words) == 0
    return capsys.readouterr().out


def test_explain_says_every_leafs_rule_a_line(capsys: pytest.CaptureFixture[str]) -> None:
    lines = said(capsys, "explain", WALL).splitlines()
    tree = load_tree(WALL)
    assert tree.hash in lines[0]
    assert lines[1:] == [f"leaf {rule.leaf_id:>2}: {rule.sentence}" for rule in rules(tree)]


def test_explain_at_a_place_says_the_rule_that_answers_there(capsys: pytest.CaptureFixture[str]) -> None:
    out = said(capsys, "explain", BALL, "--at", "0.5,-20")
    leaf_id = load_tree(BALL).answer((0.5, -0.349))[0]
    assert out == f"leaf {leaf_id}: {rules(load_tree(BALL))[leaf_id].sentence}\n"
    assert "degrees to the right" in out
    assert f"`{out.strip()}`" in " ".join((SHIPPED.parents[1] / "README.md").read_text().split())


def test_explain_at_a_place_takes_a_value_below_0_first_and_says_that_it_is_clamped(
    capsys: pytest.CaptureFixture[str],
) -> None:
    said_inside = said(capsys, "explain", BALL, "--at", "0,3")
    assert run("explain", BALL, "--at", "-5,3") == 0
    out, err = capsys.readouterr()
    assert out == said_inside
    assert err == "tree.py: --at -5,3: ball_distance lies outside the tree's range and is clamped\n"


def test_explain_as_json_has_the_rules_and_the_numbers(capsys: pytest.CaptureFixture[str]) -> None:
    found = json.loads(said(capsys, "explain", WALL, "--json"))
    tree = load_tree(WALL)
    assert found["sha256"] == tree.hash
    assert [leaf["rule"] for leaf in found["leaves"]] == [rule.sentence for rule in rules(tree)]
    assert [Leaf(leaf["left_rad_s"], leaf["right_rad_s"], leaf["patterns"]) for leaf in found["leaves"]] == list(
        tree.leaves
    )
    one = json.loads(said(capsys, "explain", WALL, "--json", "--at", "0.9,0"))
    assert [leaf["leaf_id"] for leaf in one["leaves"]] == [tree.answer((0.9, 0.0))[0]]


def test_check_says_what_a_sound_file_holds(capsys: pytest.CaptureFixture[str]) -> None:
    assert f"{WALL}: sound. wall_avoiding: 11 leaves; senses wall_distance 0 to 0.96 m" in said(capsys, "check", WALL)
    found = json.loads(said(capsys, "check", WALL, "--json"))
    assert found == {"behavior": "wall_avoiding", "leaves": 11, "sha256": load_tree(WALL).hash}


def test_export_writes_each_language_to_a_file_or_to_stdout(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    tree = load_tree(WALL)
    expected = {"c": to_c(tree), "dot": to_dot(tree), "svg": partition_svg(tree), "json": WALL.read_text()}
    for language, text in expected.items():
        assert said(capsys, "export", WALL, "--to", language) == text
        assert said(capsys, "export", WALL, "--to", language, "--out", tmp_path / "new" / language) == ""
        assert (tmp_path / "new" / language).read_text() == text
    assert ElementTree.parse(tmp_path / "new" / "svg").getroot().tag.endswith("svg")


def test_import_makes_a_tree_file_of_scikit_learns_arrays(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    (tmp_path / "arrays.json").write_text(json.dumps(ARRAYS))
    words = ("import", tmp_path / "arrays.json", "--behavior", "ball_seeking", "--out", tmp_path / "new" / "tree.json")
    assert "ball_seeking: 2 leaves" in said(capsys, *words)
    tree = load_tree(tmp_path / "new" / "tree.json")
    assert tree.features == OBSERVATIONS["ball_seeking"].features
    assert tree.answer((0.9, 0.0)) == (1, 3.0, 4.0)


def damaged(tmp_path: Path) -> Path:
    path = tmp_path / "damaged.json"
    path.write_bytes(BALL.read_bytes()[:700])
    return path


def with_a_long_number(tmp_path: Path) -> Path:
    path = tmp_path / "long.json"
    path.write_text('{"feature": [%s]}' % ("1" * 5000))
    return path


def arrays(tmp_path: Path, **changes: Any) -> Path:
    path = tmp_path / "arrays.json"
    path.write_text(json.dumps({**ARRAYS, **changes}))
    return path


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (("check", "missing.json"), "missing.json: no such file"),
        (("check", "."), ".: cannot be read (Is a directory)"),
        (("check", damaged), "damaged.json: not JSON, or truncated"),
        (("explain", damaged), "damaged.json: not JSON, or truncated"),
        (("export", damaged, "--to", "c"), "damaged.json: not JSON, or truncated"),
        (("export", BALL, "--to", "pascal"), "invalid choice: 'pascal'"),
        (("explain", BALL, "--at", "0.5"), "--at 0.5: 1 values; this tree senses ball_distance,ball_bearing"),
        (("explain", BALL, "--at", "0.5,x"), "--at 0.5,x: 'x' is not a number"),
        (("explain", BALL, "--at", "0.5,nan"), "ball_bearing is nan; it must be finite"),
        (("import", "missing", "--behavior", "ball_seeking", "--out", "x"), "missing: no such file"),
        (("import", damaged, "--behavior", "ball_seeking", "--out", "x"), "damaged.json: not JSON, or truncated"),
        (
            ("import", with_a_long_number, "--behavior", "ball_seeking", "--out", "x"),
            "long.json: a number has too many digits",
        ),
        (("import", arrays, "--behavior", "dancing", "--out", "x"), "unknown behavior 'dancing'"),
        (
            ("import", lambda place: arrays(place, feature=[7, -2, -2]), "--behavior", "ball_seeking", "--out", "x"),
            "feature[0] is 7, outside of 0 .. 1",
        ),
        ((), "the following arguments are required: COMMAND"),
    ],
)
def test_what_cannot_be_used_is_refused_in_one_line(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, words: tuple[Any, ...], reason: str
) -> None:
    assert run(*[word(tmp_path) if callable(word) else word for word in words]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    assert err.startswith("tree.py") and reason in err
    assert not Path("x").exists()


def test_a_file_that_cannot_be_written_is_refused_by_the_name_that_was_given(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    assert run("export", WALL, "--to", "c", "--out", tmp_path) == 2
    assert capsys.readouterr().err == f"tree.py: {tmp_path}: cannot be written (Is a directory); choose another place\n"
    (tmp_path / "file").touch()
    path = tmp_path / "file" / "tree.json"
    assert run("import", arrays(tmp_path), "--behavior", "ball_seeking", "--out", path) == 2
    assert capsys.readouterr().err == f"tree.py: {path}: cannot be written (Not a directory); choose another place\n"


def test_a_full_disk_is_a_failure_and_no_bad_input(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("export", WALL, "--to", "c", "--out", "/dev/full") == 1
    assert (
        capsys.readouterr().err
        == "tree.py: /dev/full: cannot be written (No space left on device); make room there, or choose another place\n"
    )


def test_change_writes_the_tree_with_another_command_in_one_leaf(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "new" / "ball_seeking.json"
    out = said(capsys, "change", BALL, "--leaf", 19, "--command", "-5,59.5", "--out", file)
    before, after = load_tree(BALL), load_tree(file)
    assert out.splitlines() == [
        f"leaf 19 was:  {rules(before)[19].sentence}",
        f"leaf 19 is:   {rules(after)[19].sentence}",
        f"tree {file}",
    ]
    assert after.leaves[19] == Leaf(-5.0, 59.5, before.wheel_leaves[19].patterns)
    assert [new for new, old in zip(after.leaves, before.leaves, strict=True) if new != old] == [after.leaves[19]]
    assert (after.nodes, after.features) == (before.nodes, before.features)
    assert after.origin["changed_from"] == before.hash
    assert after.origin["changed_from_origin"] == before.origin


def test_a_tree_that_is_changed_again_and_again_stays_readable(tmp_path: Path) -> None:
    file = tmp_path / "wall_avoiding.json"
    file.write_bytes(WALL.read_bytes())
    for count in range(40):
        assert run("change", file, "--leaf", count % 11, "--command", f"{count},3", "--out", file) == 0
    origin = load_tree(file).origin
    assert origin["changed_from"] == load_tree(WALL).hash
    assert origin["changed_leaves"] == [count % 11 for count in range(40)]


@pytest.mark.parametrize(
    ("leaf", "values", "reason"),
    [
        (101, "1,2", "--leaf 101: the tree has the leaves 0 to 100"),
        (-1, "1,2", "--leaf -1: the tree has the leaves 0 to 100"),
        (0, "1", "--command 1: 1 values; this tree commands left,right"),
        (0, "1,fast", "'fast' is not a number"),
        (0, "nan,1", "left is nan; it must be finite"),
        (0, "1,2000", "leaf 0: right_rad_s is 2000.0, outside of +-88 rad/s"),
    ],
)
def test_a_change_that_no_tree_can_have_is_refused(
    leaf: int, values: str, reason: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run("change", BALL, "--leaf", leaf, "--command", values, "--out", tmp_path / "tree.json") == 2
    line = capsys.readouterr().err
    assert line.count("\n") == 1 and reason in line
    assert not (tmp_path / "tree.json").exists()
