"""The study of scaling: more behaviors, and memory beside the product of the leaves."""

from __future__ import annotations

import json
import signal
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace

import pytest
from commands import experiment
from fbql_behaviors.shipped import shipped_trees
from fbql_behaviors.storage import load_tree
from fbql_studies.runner.study import MEASURED
from fbql_studies.scaling import study as scaling
from studies import make_short, tasks_of

TINY = ("--trees", "1", "--seeds", "1", "--max-steps", "120", "--episodes", "3", "--evaluate", "1")


def test_more_behaviors_train_and_play_and_keep_only_what_they_met(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    make_short(monkeypatch)
    monkeypatch.setattr(
        scaling, "make_tree", lambda name, _seed: SimpleNamespace(tree=load_tree(shipped_trees() / f"{name}.json"))
    )
    results = {task.key: scaling.run(task.parameters) for task in tasks_of(scaling, *TINY)}
    rows = scaling.table(results)
    assert [row["behaviors"] for row in rows] == list(scaling.COUNTS)
    products = [row["leaf_product"] for row in rows]
    assert products == sorted(products)
    for row in rows:
        assert row["joint_states"] < row["leaf_product"]
        assert row["table_bytes"] == row["leaf_product"] * row["behaviors"] * 16
    assert rows[-1]["bytes"] < 1e-6 * rows[-1]["table_bytes"]
    pytest.importorskip("matplotlib", reason="it is in requirements/study.txt")
    assert [file.name for file in scaling.figures(results, tmp_path)] == ["curves.json", "fusion_scaling.svg"]


def test_each_number_of_behaviors_adds_to_the_smaller_one() -> None:
    names = [scaling.names_of(n) for n in scaling.COUNTS]
    assert [len(set(each)) for each in names] == list(scaling.COUNTS)
    assert all(more[: len(fewer)] == fewer for fewer, more in pairwise(names))


def test_the_commands_workers_give_the_results_of_this_process(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("matplotlib", reason="it is in the requirements of the studies")
    monkeypatch.setattr(scaling, "COUNTS", (3,))
    monkeypatch.setattr(signal, "signal", lambda *_: None)  # the command would keep the signals' handlers
    arguments = (*TINY, "--max-steps", "5")
    (task,) = tasks_of(scaling, *arguments)
    assert experiment(["scaling", *arguments, "--json", "--out", str(tmp_path), "--jobs", "1"]) == 0
    assert json.loads(capsys.readouterr().out)["done"] == 1
    stored = json.loads((tmp_path / "tasks" / f"{task.key}.json").read_text())
    assert {**stored, MEASURED: 0} == {**scaling.run(task.parameters), MEASURED: 0}
