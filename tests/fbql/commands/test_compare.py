"""`compare.py`: seeds of one kind together, everything else side by side."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from commands import compare as main
from commands import train
from fbql.report.comparison import FEW_RUNS, RunResult, groups_of, name_of, pairs_of, result_of
from fbql.statistics.inference import ratio_of_sums
from fbql_behaviors.core.tree import Leaf, Tree
from fbql_behaviors.storage import load_tree, save_tree
from fbql_recording.run import open_run
from hostile_run import HOSTILE, hostile_run
from recorded_match import TREES, record_match


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Subsumption with two seeds, with the paper's thresholds, with another tree; equal weights. Not to be changed."""
    root = tmp_path_factory.mktemp("runs")
    other_trees = root / "other_trees"
    shutil.copytree(TREES, other_trees)
    tree = load_tree(other_trees / "wall_avoiding.json")
    leaves = (Leaf(-50.0, 5.0, 1), *tree.leaves[1:])
    (other_trees / "wall_avoiding.json").unlink()
    save_tree(other_trees / "wall_avoiding.json", Tree(tree.behavior, tree.features, tree.nodes, leaves, tree.origin))
    options: dict[str, dict[str, Any]] = {
        "one": {"seed": 1},
        "two": {"seed": 2},
        "paper": {"seed": 1, "preset": "paper"},
        "trees": {"seed": 1, "trees": other_trees},
        "uniform": {"seed": 2, "controller": "uniform"},
    }
    return {name: record_match(root / name, max_steps=450, episodes=2, **each) for name, each in options.items()}


def compared(capsys: pytest.CaptureFixture[str], *arguments: object, code: int = 0) -> dict[str, Any]:
    assert main([*map(str, arguments), "--json"]) == code
    return json.loads(capsys.readouterr().out)


def test_seeds_are_taken_together_and_all_else_is_told_apart(runs, capsys):
    found = compared(capsys, *runs.values())
    assert [(run["run"], run["kind"]) for run in found["runs"]] == list(zip(runs, "AABCD", strict=True))
    assert [kind["runs"] for kind in found["kinds"]] == [2, 1, 1, 1]
    labels = [kind["label"] for kind in found["kinds"]]
    hashes = {load_tree(runs[name] / "trees" / "wall_avoiding.json").hash for name in ("one", "trees")}
    assert len(hashes) == 2
    assert all(label.startswith("subsumption") for label in labels[:3]) and labels[3].startswith("uniform")
    assert "preset tuned" in labels[0] and "preset paper" in labels[1]
    trees = [label.partition("tree of wall_avoiding ")[2][:8] for label in labels]
    assert trees[0] == trees[1] == trees[3] != trees[2]
    assert not any("seed" in label for label in labels)


def test_counts_are_those_of_the_recording(runs, capsys):
    found = compared(capsys, runs["one"], runs["two"])
    for row in found["runs"]:
        summary = open_run(runs[row["run"]]).summary
        assert summary is not None
        for name, key in (("episodes", "episodes"), ("goals", "goals"), ("digest", "digest"), ("seed", "seed")):
            assert row[name] == summary[key]
        assert row["collisions"] == summary["collisions_begun"]
    summaries = [open_run(runs[name]).summary or {} for name in ("one", "two")]
    expected = ratio_of_sums([each["steps"] for each in summaries], [each["goals"] for each in summaries])
    kind = found["kinds"][0]
    assert kind["cost_per_goal"] == pytest.approx(expected.estimate)
    assert [kind["cost_per_goal_low"], kind["cost_per_goal_high"]] == pytest.approx(expected[1:])


def test_one_run_has_no_interval(runs, capsys):
    kind = compared(capsys, runs["one"], runs["paper"])["kinds"][0]
    assert kind["success_rate"] is not None
    assert kind["success_rate_low"] is None and kind["success_rate_high"] is None


def test_a_copy_of_a_run_is_no_second_seed(runs, tmp_path, capsys):
    copy = shutil.copytree(runs["one"], tmp_path / "copy")
    found = compared(capsys, runs["one"], copy, runs["two"])
    assert found["kinds"][0]["runs"] == 2
    assert any("copy is the same run as one" in note for note in found["notes"])
    assert [run["kind"] for run in found["runs"]] == ["A", None, "A"]


def run_of(seed: int, goals: int, steps: int, controller: str = "a") -> RunResult:
    counts = {"episodes": 10, "goals": goals, "own_goals": 0, "timeouts": 10 - goals, "steps": steps, "collisions": 3}
    return RunResult(f"{controller}{seed}", controller, seed, {"controller": controller}, counts, f"{seed}", True)


def test_kinds_are_paired_over_the_seeds_that_both_have():
    ours = [run_of(seed, 10, 1000) for seed in range(8)]
    theirs = [run_of(seed, 5, 1000 + seed, "b") for seed in range(1, 12)]
    kinds, notes = groups_of([*ours, *theirs])
    (pair,) = pairs_of(kinds)
    assert (pair.letter, pair.against, pair.seeds) == ("B", "A", 7)
    assert pair.cost_ratio == pytest.approx((7000 + sum(range(1, 8))) / 35 / 100)
    assert pair.p is not None and pair.p < 0.03
    assert notes == []


def test_few_seeds_are_called_few():
    _, notes = groups_of([run_of(seed, 10, 1000) for seed in range(FEW_RUNS - 1)])
    assert len(notes) == 1 and "too narrow" in notes[0]


def test_without_a_goal_a_cost_is_not_available():
    kinds, _ = groups_of([run_of(0, 0, 1000), run_of(0, 0, 1000, "b")])
    assert kinds[0].row["cost_per_goal"] is None
    assert pairs_of(kinds)[0].cost_ratio is None


def test_more_kinds_than_letters_are_told_apart():
    kinds, _ = groups_of([run_of(0, 1, 10, f"c{index}") for index in range(30)])
    assert [kind.letter for kind in kinds][25:28] == ["Z", "AA", "AB"]


def test_runs_of_one_name_are_called_by_more_of_their_path():
    paths = [Path("/a/x/run"), Path("/a/y/run"), Path("/a/y/other")]
    assert [name_of(path, paths) for path in paths] == ["x/run", "y/run", "other"]


def test_words_and_figure_tell_the_same(runs, tmp_path, capsys):
    pytest.importorskip("matplotlib", reason="it is in requirements-study.txt")
    figure = tmp_path / "figure.svg"
    assert main([*map(str, runs.values()), "--figure", str(figure)]) == 0
    words = capsys.readouterr().out
    texts = [each.text or "" for each in ElementTree.parse(figure).iter() if each.tag.endswith("text")]
    for letter in "ABCD":
        (label,) = [text for text in texts if text.startswith(f"{letter}: ")]
        assert label in words
    dots = [each for each in ElementTree.parse(figure).iter() if (each.get("id") or "").startswith("runs_")]
    assert len(dots) >= 4 * 3
    assert main([*map(str, runs.values()), "--figure", str(figure)]) == 2
    assert "figure.svg exists; --force replaces it" in capsys.readouterr().err


def test_hostile_names_are_texts_and_nothing_else(runs, tmp_path, capsys):
    hostile = hostile_run(tmp_path / "hostile")
    assert main([str(hostile), str(runs["one"])]) == 0
    words = capsys.readouterr().out
    assert "\u202e" not in words and "\t" not in words
    assert result_of(open_run(hostile)).seed is None
    pytest.importorskip("matplotlib", reason="it is in requirements-study.txt")
    figure = tmp_path / "figure.svg"
    assert main([str(hostile), str(runs["one"]), "--figure", str(figure)]) == 0
    tags = {each.tag.rpartition("}")[2] for each in ElementTree.parse(figure).iter()}
    assert tags.isdisjoint({"script", "image", "a", "foreignObject", "b"})
    assert HOSTILE[:20] in "".join(each.text or "" for each in ElementTree.parse(figure).iter())


def test_what_is_wrong_is_one_line_and_exit_code_2(runs, tmp_path, capsys):
    for arguments, why in (([runs["one"]], "two runs"), ([runs["one"], tmp_path / "none"], "no such run")):
        assert main([*map(str, arguments)]) == 2
        error = capsys.readouterr().err
        assert error.startswith("compare.py: ") and why in error and error.count("\n") == 1


def test_an_incomplete_recording_exits_with_3(runs, tmp_path, capsys):
    unfinished = record_match(tmp_path / "run", max_steps=300, close=False)
    found = compared(capsys, runs["one"], unfinished, code=3)
    assert [run["complete"] for run in found["runs"]] == [True, False]
    compared(capsys, runs["one"], unfinished, "--allow-incomplete")


def test_a_run_that_was_not_recorded_is_compared_with_one_that_was(tmp_path, capsys):
    options = ("--controller", "subsumption", "--episodes", "2", "--max-steps", "450", "--json")
    for name, seed in (("one", 1), ("two", 2)):
        assert train([*options, "--seed", str(seed), "--out", str(tmp_path / name)]) == 0
    recorded = record_match(tmp_path / "recorded", max_steps=450, episodes=2, seed=1)
    capsys.readouterr()
    found = compared(capsys, tmp_path / "one", tmp_path / "two", recorded)
    one, _, same = found["runs"]
    keys = ("episodes", "goals", "own_goals", "timeouts", "cost_per_goal", "collisions", "digest", "complete")
    assert [one[key] for key in keys] == [same[key] for key in keys]
    assert found["kinds"][0]["runs"] == 2


@pytest.mark.parametrize(
    ("name", "text", "says"),
    [
        ("episodes.csv", "index,phase\n0,learning\n", "episodes.csv has no such rows"),
        ("summary.json", "[", "summary.json: not JSON"),
        ("summary.json", None, "summary.json is not there, and there is no recording"),
        ("config.yaml", "a: 1", "config.yaml has no parameters"),
    ],
)
def test_files_that_are_not_those_of_a_run_are_one_line(name, text, says, tmp_path, capsys):
    for each in ("one", "two"):
        assert (
            train(
                ["--controller", "subsumption", "--episodes", "1", "--max-steps", "60", "--out", str(tmp_path / each)]
            )
            == 0
        )
    (tmp_path / "two" / name).unlink()
    if text is not None:
        (tmp_path / "two" / name).write_text(text)
    capsys.readouterr()
    assert main([str(tmp_path / "one"), str(tmp_path / "two")]) == 2
    assert says in capsys.readouterr().err.splitlines()[-1]
