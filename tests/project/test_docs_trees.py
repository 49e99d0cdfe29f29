"""docs/trees.md tells what the studies of trees and of leaf tuning found, and what the commands that it names print."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from functools import cache
from typing import Any

import pytest
from fbql.demonstrations.instruct import instruct
from fbql.demonstrations.make_tree import DEMONSTRATION_SEED, INDUCTION_SEED
from fbql_behaviors.core.induction import induce
from fbql_behaviors.core.observation import OBSERVATIONS
from fbql_behaviors.core.patterns import Patterns, patterns_of
from fbql_behaviors.core.recipes import RECIPES
from fbql_studies.common.team_play import FIXED_ONLY, SETTINGS
from fbql_studies.leaf_tuning.tables import FRESH, PRINTED, SHIPPED
from fbql_studies.trees.methods import FAMILIES
from fbql_studies.trees.tables import SHOWN
from places import ROOT

DOCS = ROOT / "docs"
SEEDS = {"trees": 10, "objectives": 40, "leaf_tuning": 5}
"""Study -> seeds that it must have at least."""


def page() -> str:
    return (DOCS / "trees.md").read_text()


def data(study: str) -> dict[str, Any]:
    return json.loads((DOCS / "data" / f"{study}.json").read_text())


@pytest.mark.parametrize("study", SEEDS)
def test_the_data_have_enough_seeds(study: str) -> None:
    assert data(study)["options"]["seeds"] >= SEEDS[study]


def test_the_data_of_trees_hold_every_method_behavior_and_setting_over_every_seed() -> None:
    rows = data("trees")["table"]
    methods = {method for family in FAMILIES.values() for method in family}
    made = {(row["method"], row["behavior"]): row["n"] for row in rows if "rmse_levels" in row}
    assert set(made) == {(method, behavior) for method in methods for behavior in RECIPES}
    played = {(row["method"], row["thresholds"]): row["n"] for row in rows if "thresholds" in row}
    assert {method for method, name in played if name in FIXED_ONLY} == methods
    assert {(method, name) for method in SHOWN for name in SETTINGS} - set(played) == {("one leaf", "re-tuned")}
    assert min(*made.values(), *played.values()) >= SEEDS["trees"]


def test_the_data_of_objectives_hold_both_over_every_seed_and_say_what_the_page_concludes() -> None:
    """The default objective follows from play: what remains when the measures of play are many comparisons."""
    rows = data("objectives")["table"]
    assert min(row["n"] for row in rows) >= SEEDS["objectives"]
    played = [row for row in rows if row["where"] in SETTINGS]
    assert len(played) == 18
    sure = {(row["where"], row["measure"]): row["difference"] for row in played if row["p"] < 0.05 / len(played)}
    contact = {(name, "contact steps per episode") for name in SETTINGS}
    assert set(sure) == contact | {("paper", "collisions begun per episode")}
    assert min(sure.values()) > 0.0, "each is a measure that is to be low, and lower with the weighted objective"


def test_the_data_of_leaf_tuning_hold_every_behavior_and_the_team_with_every_kind_of_trees() -> None:
    rows = data("leaf_tuning")["table"]
    assert {(row["trees"], row["tuned"]) for row in rows} == {
        (trees, tuned) for trees in (SHIPPED, PRINTED, FRESH) for tuned in (*RECIPES, "all")
    }
    assert min(row["n"] for row in rows) >= SEEDS["leaf_tuning"]


@cache
def patterns() -> Patterns:
    recipe = RECIPES["ball_seeking"]
    demonstrations = instruct("ball_seeking", DEMONSTRATION_SEED, recipe.demonstrations, recipe.steps)
    return patterns_of(demonstrations, OBSERVATIONS["ball_seeking"], recipe.every, recipe.patterns)


def test_the_values_that_eq_4_as_printed_leads_to_are_as_told() -> None:
    told = re.findall(r"^\| (\d+) \| ([\d.]+), (\d+) \| ([\d.]+), (\d+) \|$", page(), flags=re.MULTILINE)
    assert [row[0] for row in told] == ["5", "20", "50", "200"]
    printed = replace(RECIPES["ball_seeking"].printed, optimism=0.0, epsilon_start=1.0, epsilon_end=0.0)
    for trials, *cells in told:
        for update, value, leaves in (("printed", *cells[:2]), ("converging", *cells[2:])):
            parameters = replace(printed, trials=int(trials), update=update)
            found = induce("ball_seeking", patterns(), parameters, INDUCTION_SEED)
            assert (f"{found.value:.3g}", found.tree.leaf_count) == (f"{float(value):.3g}", int(leaves))
    exact = induce("ball_seeking", patterns(), replace(printed, method="dp"), INDUCTION_SEED).value
    assert f"whose exact value is {exact:.4f} nat" in " ".join(page().split())
