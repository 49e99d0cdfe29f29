"""The study of trees: what its tasks are, that they repeat, and that its tables and figures say what was counted."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from fbql_behaviors.core.observation import Feature
from fbql_behaviors.core.patterns import patterns_from_rows
from fbql_behaviors.core.quantizer import LEVEL_RAD_S, class_of_levels
from fbql_behaviors.core.tree import Leaf, Split, Tree
from fbql_behaviors.shipped import shipped_trees
from fbql_behaviors.storage import load_tree
from fbql_common.core.errors import BadInput
from fbql_fusion.core.tasks.soccer.subsumption import Thresholds

for package in ("sklearn", "matplotlib"):
    pytest.importorskip(package, reason=f"{package} is in requirements/study.txt")

from fbql.statistics.tables import as_markdown  # noqa: E402
from fbql_studies.common import pattern_sets, team_play  # noqa: E402
from fbql_studies.common.play import Score  # noqa: E402
from fbql_studies.common.tuning import TUNING_SEED  # noqa: E402
from fbql_studies.runner.study import MEASURED  # noqa: E402
from fbql_studies.trees import figures, methods, optimal  # noqa: E402
from fbql_studies.trees import study as trees  # noqa: E402
from studies import FEW_DEMONSTRATIONS, tasks_of  # noqa: E402

FEATURES = (Feature("distance", "m", 0.0, 1.6), Feature("bearing", "rad", -2.0, 2.0))


def score_of_leaves(found: Mapping[str, Tree], thresholds: Thresholds, seed: int, episodes: int) -> Score:
    """Instead of play: trees of one leaf never score, others the sooner the more leaves they have."""
    leaves = sum(tree.leaf_count for tree in found.values())
    goals = 0 if leaves == 3 else episodes
    return Score(episodes, goals, 0, episodes - goals, 10_000 // leaves + seed % 7, 2, 4)


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    """Few demonstrations, few sizes, no play."""
    monkeypatch.setattr(pattern_sets, "RECIPES", FEW_DEMONSTRATIONS)
    monkeypatch.setattr(trees, "score", score_of_leaves)
    monkeypatch.setattr(team_play, "score", score_of_leaves)
    monkeypatch.setattr(trees, "KNOWN_SEEDS", range(1, 3))
    monkeypatch.setattr(trees, "SPLIT_COSTS", (0.01, 0.1))
    monkeypatch.setattr(trees, "LEAF_COUNTS", (2, 8))
    monkeypatch.setattr(figures, "TRIALS", (5, 50))
    monkeypatch.setattr(figures, "DIVERGENCE_TRIALS", 10)
    families = {
        name: {method: make for method, make in family.items() if not re.search(r" (20|200|1000)\b", method)}
        for name, family in methods.FAMILIES.items()
    }
    monkeypatch.setattr(trees, "FAMILIES", families)


def test_every_seed_has_a_task_for_every_family_and_no_seed_was_seen_by_tuning() -> None:
    keys = [task.key for task in tasks_of(trees, "--seeds", "2")]
    assert len(set(keys)) == len(keys) == 1 + 2 * len(methods.FAMILIES)  # sizes, but not the optimal ones
    assert all(task.parameters.get("seed", 1001) >= 1000 for task in tasks_of(trees))
    assert TUNING_SEED < 1000 <= trees.FIRST_SEED
    assert max(trees.KNOWN_SEEDS) < trees.FIRST_SEED


def test_optimal_are_a_part_only_where_pystreed_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(BadInput, match="pip install --target"):
        tasks_of(trees, "--pystreed", str(tmp_path))
    (tmp_path / "pystreed.py").touch()
    monkeypatch.syspath_prepend(str(tmp_path))
    assert "1001-optimal" in [task.key for task in tasks_of(trees, "--pystreed", str(tmp_path))]


@pytest.mark.parametrize("name", ["seeds", "episodes"])
def test_a_study_of_nothing_is_refused(name: str) -> None:
    with pytest.raises(BadInput, match=f"--{name} is 0"):
        tasks_of(trees, f"--{name}", "0")


@pytest.mark.usefixtures("small")
def test_the_study_makes_plays_and_draws_trees_twice_the_same(tmp_path: Path) -> None:
    results: dict[str, Any] = {"known-seeds": trees.run({"part": "known"})}
    results["1001-sizes"] = trees.run({"part": "sizes", "seed": 1001})
    for family in ("weighted", "printed", "weighted-from-0", "printed-from-0", "others"):
        for seed in (1001, 1002) if family in ("weighted", "others") else (1001,):
            parameters = {"part": family, "seed": seed, "episodes": 1, "pystreed": None}
            results[f"{seed}-{family}"] = trees.run(parameters)
    again = trees.run({"part": "others", "seed": 1001, "episodes": 1, "pystreed": None})
    for result in (again, once := json.loads(json.dumps(results["1001-others"]))):
        assert set(result.pop(MEASURED)) == {"seconds"}
    assert again == once

    rows = trees.table(results)
    json.dumps(rows, allow_nan=False)
    made = [row for row in rows if "rmse_levels" in row]
    played = [row for row in rows if "cost_per_goal" in row]
    methods = {method for name, family in trees.FAMILIES.items() if name != "optimal" for method in family}
    assert {row["method"] for row in made} == {row["method"] for row in played} == methods
    assert {row["n"] for row in made if row["method"] == "cart"} == {2}
    assert [row["leaves"] for row in made if row["method"] == "one leaf"] == [1, 1, 1]
    equal = {(row["method"], row["behavior"]): row["leaves_high"] for row in made}
    assert all(equal["cart", behavior] <= equal["weighted dp", behavior] for behavior in FEW_DEMONSTRATIONS)
    exact = [row["value_to_dp"] for row in made if row["method"] in ("weighted dp", "printed dp")]
    assert [each for each in exact if each is not None] == pytest.approx([1.0] * 5)  # one can't split so few patterns
    assert {row["episodes"] for row in played if row["method"] == "one leaf"} == {2}
    assert all(row["n"] == 2 for row in rows if "band" in row)
    costed = [row for row in rows if row.get("sized_by") == "weighted"]
    assert [(row["limit"], row["n"]) for row in costed] == [(0.01, 1), (0.1, 1)] * 3
    assert all(
        dear["median_leaves"] <= cheap["median_leaves"] for cheap, dear in zip(costed[::2], costed[1::2], strict=True)
    )

    assert any("| weighted rl 50 |" in as_markdown(each) for each in trees.words(rows).values())
    files = trees.figures(results, tmp_path)
    assert {file.name for file in files} == {
        f"trees_{name}.svg"
        for name in ("patterns", "partition", "divergence", "leaf_counts", "sizes", "trials", "play")
    }
    for file in files:
        assert ElementTree.parse(file).getroot().tag == "{http://www.w3.org/2000/svg}svg"
        assert file.stat().st_size < 200_000


def test_play_counts_every_episode_and_repeats() -> None:
    made = {name: load_tree(shipped_trees() / f"{name}.json") for name in trees.RECIPES}
    found = [team_play.score(made, team_play.PRESETS["fixed"], seed, 2) for seed in (1001, 1001, 1002)]
    assert found[0] == found[1] != found[2]
    assert found[0].episodes == found[0].goals + found[0].own_goals + found[0].timeouts == 2
    assert found[0].steps > 0


def test_retuned_thresholds_are_the_cheapest_on_the_tuning_episodes(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: set[tuple[int, int]] = set()

    def score(_trees: object, thresholds: Thresholds, seed: int, episodes: int) -> Score:
        asked.add((seed, episodes))
        goals = 0 if thresholds.wall_m == 0.06 else 2
        return Score(2, goals, 0, 0, round(1000 * abs(thresholds.approach_rad - 0.3)), 0, 0)

    monkeypatch.setattr(team_play, "score", score)
    assert team_play.retuned({}) == (0.07, 0.3)
    assert asked == {(TUNING_SEED, team_play.TUNING_EPISODES)}


def result_of(method: str, scores: Sequence[tuple[int, int]]) -> dict[str, Any]:
    """Results of a method whose trees needed (steps, goals) with each seed."""
    tree = dict.fromkeys(("leaves", "rmse_levels", "rmse_training", "value", "belief"), 1.0)
    return {
        f"{1001 + k}-x": {
            "methods": {
                method: {
                    "trees": dict.fromkeys(trees.RECIPES, tree),
                    "play": {
                        name: {**Score(10, goals, 10 - goals, 0, steps, 3, 6)._asdict()} for name in team_play.SETTINGS
                    },
                }
            },
            MEASURED: {"seconds": {method: dict.fromkeys(trees.RECIPES, 0.5)}},
        }
        for k, (steps, goals) in enumerate(scores)
    }


def test_cost_of_a_goal_is_all_steps_over_all_goals_and_is_compared_on_the_same_seeds() -> None:
    found = {"weighted rl 50": [(1000, 10), (3000, 5)], "printed rl 50": [(2000, 10), (6000, 5)]}
    merged: dict[str, Any] = {}
    for method, scores in found.items():
        for key, result in result_of(method, scores).items():
            merged[f"{key}-{method}"] = result
    played = {(row["method"], row["thresholds"]): row for row in trees.table(merged) if "cost_per_goal" in row}
    ours, theirs = played["weighted rl 50", "fixed"], played["printed rl 50", "fixed"]
    assert ours["cost_per_goal"] == pytest.approx(4000 / 15)
    assert ours["success_rate"] == pytest.approx(0.75)
    assert ours["own_goals"] == pytest.approx(0.25)
    assert (ours["collisions_begun"], ours["collision_steps"]) == pytest.approx((0.3, 0.6))
    assert (ours["cost_to_shipped"], ours["p"]) == (None, None)
    assert [theirs[name] for name in ("cost_to_shipped", "ratio_low", "ratio_high")] == pytest.approx([2.0] * 3)
    assert theirs["p"] > 0.2  # two seeds prove nothing


def test_leaves_of_a_partition_get_the_mean_of_their_patterns_and_empty_ones_stay() -> None:
    tree = Tree("x", FEATURES, (Split(0, 0.8, 1, 2), 0, 1), (Leaf(1.0, 2.0, 3), Leaf(4.0, 5.0, 6)))
    patterns = patterns_from_rows(FEATURES, [(0.1, 0.0), (0.2, 1.0)], [class_of_levels(2, 4), class_of_levels(4, -4)])
    found = methods.with_leaf_means(tree, patterns)
    assert found.nodes == tree.nodes
    assert found.leaves == (Leaf(pytest.approx(3 * LEVEL_RAD_S), 0.0, 2), Leaf(4.0, 5.0, 6))


def test_a_tree_of_pystreed_becomes_ours() -> None:
    def leaf() -> Any:
        return SimpleNamespace(is_leaf_node=lambda: True)

    def node(feature: int, left: Any, right: Any) -> Any:
        return SimpleNamespace(is_leaf_node=lambda: False, feature=feature, left_child=left, right_child=right)

    cuts = [(0, 0.4), (0, 0.8), (1, 0.0)]
    patterns = patterns_from_rows(FEATURES, [(0.1, 0.1)], [0])
    tree = optimal.as_ours(node(1, node(0, leaf(), leaf()), node(2, leaf(), leaf())), "x", patterns, cuts)
    x = np.array([(0.39, 0.0), (0.4, 0.0), (0.8, -0.1), (0.8, 0.0)])
    assert tree.leaf_ids(x).tolist() == [0, 1, 2, 3]
