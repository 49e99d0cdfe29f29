"""The benchmark of induction runs and tells what it says it tells; how fast things are is not a test's business."""

from __future__ import annotations

import json

import pytest
from measure import induction

KEYS = {"rl50_ms", "dp_ms", "cart_ms", "dp_over_cart", "decision_us"}


def test_the_benchmark_of_induction_prints_one_object_with_its_figures(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("sklearn", reason="CART is scikit-learn's, which is in requirements/study.txt")
    monkeypatch.setattr(induction, "GROWTH", (1000, 2000))
    assert induction.main(["--rounds", "1", "--growth", "--json"]) == 0
    printed = capsys.readouterr().out
    assert printed.count("\n") == 1
    result = json.loads(printed)
    assert set(result) >= KEYS
    assert all(result[key] > 0.0 for key in KEYS)
    assert set(result["behaviors"]) == {"ball_seeking", "wall_avoiding", "approaching"}
    assert [row["patterns"] for row in result["growth"]] == [1000, 2000]
    assert induction.main(["--rounds", "0"]) == 2
    assert "--rounds is 0" in capsys.readouterr().err
