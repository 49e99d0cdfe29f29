"""Methods over their runs: paired with a control run by run, and what is not known."""

from __future__ import annotations

from math import inf
from typing import Any

import pytest
from fbql.statistics.runs import cost_ratio, method_row, runs_by_method


def row(method: str, tree_seed: int, seed: int, steps: int, **figures: int) -> dict[str, Any]:
    counted = {"goals": 100, "own_goals": 0, "timeouts": 0, "episodes": 100, "collisions_begun": 100}
    counted |= {"collision_steps": 500, "steps_to_goals": steps, **figures}
    return {"method": method, "tree_seed": tree_seed, "seed": seed, "steps": steps, **counted}


def test_a_method_is_paired_with_its_control_run_by_run() -> None:
    found = [row("a", 1, 0, 500), row("a", 1, 1, 700), row("b", 1, 0, 1000), row("b", 1, 1, 1000), row("b", 2, 0, 9000)]
    by_method = runs_by_method(found, ("b", "a"))
    assert list(by_method) == ["b", "a"]
    assert cost_ratio(by_method["a"], by_method["b"]).estimate == pytest.approx(0.6)
    told = method_row("a", by_method, {"b": "b", "gone": "c"})
    assert (told["ratio_b"], told["ratio_gone"], told["p_gone"]) == (pytest.approx(0.6), None, None)
    assert told["ratio_b_low"] <= told["ratio_b"] <= told["ratio_b_high"]


def test_a_control_without_a_goal_gives_no_ratio_and_a_method_without_one_has_no_cost() -> None:
    none = row("none", 1, 0, 4000, goals=0, timeouts=100, steps_to_goals=0)
    by_method = runs_by_method([none, row("a", 1, 0, 500)], ("none", "a"))
    assert method_row("a", by_method, {"c": "none"})["ratio_c"] is None
    told = method_row("none", by_method, {"c": "a"})
    assert (told["cost_per_goal"], told["ratio_c"], told["success_rate"]) == (None, None, 0.0)
    assert cost_ratio(by_method["none"], by_method["a"]).estimate == inf
