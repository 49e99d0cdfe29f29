"""The studies of fusion that learns: which seeds do what, that tasks repeat, and that tables say what was counted."""

from __future__ import annotations

import argparse
import json
import re
import signal
from collections.abc import Iterator
from itertools import pairwise
from math import inf
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from commands import experiment as main
from fbql.statistics import runs as comparison
from fbql.statistics.runs import cost_ratio, method_row, runs_by_method
from fbql_behaviors.core.behavior import Behavior
from fbql_behaviors.shipped import shipped_trees
from fbql_behaviors.storage import load_tree
from fbql_common.core.errors import BadInput
from fbql_fusion.core.parameters import FusionParameters
from fbql_sim.core.parameters import SimulationParameters
from fbql_sim.core.world_loop import WorldLoop
from fbql_studies import (
    ablation,
    fusion_controls,
    fusion_words,
    ladder,
    methods,
    paper,
    scaling,
    sensitivity,
    tuning,
    variants,
)
from fbql_studies.constant_blend import BLEND_ROUNDS, best_blend, blend_played
from fbql_studies.learning_curves import growth, learning
from fbql_studies.methods import LEARNERS
from fbql_studies.paper import RETUNED, after_guidance
from fbql_studies.peers_study import evaluation_seed_of
from fbql_studies.runner.study import MEASURED, Result, Task
from fbql_studies.training import (
    MOST_TREE_SETS,
    SEEDS_OF_A_TREE_SET,
    Seeds,
    frozen,
    law_played,
    size_of,
    train,
    training_of,
)
from fbql_studies.weight_maps import weight_maps

STUDIES = (ladder, ablation, sensitivity, scaling, paper)
TRAINING = (ladder, ablation, sensitivity, scaling)
VARIED = (ablation, sensitivity)
CHANGES = {variants.as_set(each): each for study in VARIED for each in study.VARIANTS.trained.values()}
MAX_STEPS = 120
SMALL = ("--trees", "1", "--seeds", "1", "--max-steps", str(MAX_STEPS))
TINY = (*SMALL, "--episodes", "6", "--evaluate", "2")


def tasks(study: ModuleType, *arguments: str) -> list[Task]:
    parser = argparse.ArgumentParser()
    study.add_options(parser)
    return study.tasks(parser.parse_args(list(arguments)))


def shipped() -> list[Behavior]:
    return [Behavior(name, load_tree(shipped_trees() / f"{name}.json")) for name in methods.BEHAVIORS]


@pytest.fixture
def short(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """The trees that ship, and the shortest tuning there is."""
    monkeypatch.setattr(Seeds, "behaviors", lambda _seeds, _set: shipped())
    monkeypatch.setattr(tuning, "WALL_M", (0.07,))
    monkeypatch.setattr(tuning, "APPROACH_RAD", (0.15,))
    monkeypatch.setattr(tuning, "TUNING_ROUNDS", ((2, 1),))
    monkeypatch.setattr("fbql_studies.constant_blend.BLEND_ROUNDS", ((2, 1),))
    yield


@pytest.fixture(scope="module")
def loop() -> WorldLoop:
    return WorldLoop(SimulationParameters(max_steps=MAX_STEPS))


@pytest.fixture(scope="module")
def long_loop() -> WorldLoop:
    """Episodes in which a guide scores: a learner by values learns of nothing else."""
    return WorldLoop(SimulationParameters(max_steps=1000))


@pytest.mark.parametrize("study", STUDIES)
def test_tasks_are_plain_and_their_keys_are_unique_file_names(study: ModuleType) -> None:
    found = tasks(study, "--trees", "3", "--seeds", "9")
    assert len({task.key for task in found}) == len(found)
    assert all(re.fullmatch(r"[A-Za-z0-9._-]+", task.key) for task in found)
    assert json.loads(json.dumps([task.parameters for task in found])) == [task.parameters for task in found]


@pytest.mark.parametrize("study", TRAINING)
def test_numbers_out_of_range_are_refused(study: ModuleType) -> None:
    for option in ("--trees", "--seeds", "--episodes", "--evaluate", "--max-steps"):
        with pytest.raises(BadInput, match=f"^{option} is 0; it must be 1 to"):
            tasks(study, option, "0")


def test_no_study_shares_a_seed_or_a_tree_with_another_and_none_judges_what_it_trained_or_tuned_on() -> None:
    seeds, trees = set(range(paper.FIRST_RUN_SEED)), set[int]()
    for study in TRAINING:
        training = {study.SEEDS.training(k) for k in range(SEEDS_OF_A_TREE_SET)}
        judging = {study.SEEDS.judging(k, j) for k in range(MOST_TREE_SETS) for j in range(SEEDS_OF_A_TREE_SET)}
        sets = {study.SEEDS.tree(k) for k in range(MOST_TREE_SETS)}
        assert len(judging) == MOST_TREE_SETS * SEEDS_OF_A_TREE_SET
        for used in (training, judging):
            assert not used & seeds
            seeds |= used
        assert not sets & trees
        trees |= sets
    assert tuning.TUNING_SEED < paper.FIRST_RUN_SEED


def test_the_ladder_judges_on_the_episodes_of_the_peers() -> None:
    assert ladder.SEEDS.judging(2, 3) == evaluation_seed_of(2, 3)


@pytest.mark.parametrize(("learner", "floats"), [("fbql", 3 + 1), ("fbql_value", 4)])
def test_a_training_is_counted_whole_and_its_course_in_pieces(
    learner: str, floats: int, loop: WorldLoop, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("fbql_studies.training.CURVE_EPISODES", 4)
    trained = train(training_of(5, 10, learner), shipped(), loop)
    assert [part["episodes"] for part in trained.curve] == [4, 4, 2]
    assert all(part["goals"] + part["own_goals"] + part["timeouts"] == part["episodes"] for part in trained.curve)
    met = [part["joint_states"] for part in trained.curve]
    assert met == sorted(met)
    assert 0 < met[0] < met[-1] == trained.size["joint_states"] < trained.size["leaf_product"]
    assert trained.size["features"] == len(trained.policy.arrays["keys"])
    keys = trained.policy.arrays["keys"].nbytes
    assert trained.size["bytes"] == 8 * trained.size["features"] * floats + keys


@pytest.mark.parametrize(("learner", "table", "updates"), [("fbql", "theta", 0), ("fbql_value", "values", 1)])
def test_what_was_only_guided_learned_from_the_guide_and_nothing_more(
    learner: str, table: str, updates: int, long_loop: WorldLoop
) -> None:
    policy = after_guidance(training_of(5, 10, learner), shipped(), long_loop)
    assert np.abs(policy.arrays[table]).max() > 0.0
    assert policy.arrays["counts"].tolist() == [0, updates]
    assert size_of(policy)["features"] > 100


@pytest.mark.parametrize("learner", LEARNERS)
def test_frozen_play_meets_the_same_episodes_whatever_plays_and_repeats(learner: str, loop: WorldLoop) -> None:
    fusion = training_of(5, 10, learner)
    trained = train(fusion, shipped(), loop)
    once = frozen(fusion, shipped(), loop, 77, 5, trained.policy)
    assert frozen(fusion, shipped(), loop, 77, 5, trained.policy) == once
    assert frozen(fusion, shipped(), loop, 77, 5) != once, "it is not what was learned that plays"
    assert once["episodes"] == 5


def test_the_law_plays_the_episodes_of_the_run_seed() -> None:
    pytest.importorskip("gymnasium", reason="an optional extra, which is in requirements-test.txt")
    from fbql_studies.peers.play import score_of_law

    found = law_played(WorldLoop(), 77, 3)
    assert score_of_law(77, 3)._asdict() == {name: found[name] for name in score_of_law(77, 3)._fields}
    assert found["goals"] == 3
    assert found["steps"] == found["steps_to_goals"]


@pytest.mark.usefixtures("short")
@pytest.mark.parametrize("study", [ladder, *VARIED])
def test_a_task_gives_the_same_result_again_and_the_table_has_every_method(study: ModuleType, tmp_path: Path) -> None:
    found = [task for task in tasks(study, *TINY) if task.parameters["part"] in (*ladder.TRAINED, "controls")]
    results: dict[str, Result] = {}
    for task in found:
        result = study.run(task.parameters)
        assert json.loads(json.dumps(result, allow_nan=False)) == result
        assert {**study.run(task.parameters), MEASURED: 0} == {**result, MEASURED: 0}
        results[task.key] = result
    rows = study.table(results)
    json.dumps(rows, allow_nan=False)
    told = [row["method"] for row in rows if "method" in row]
    expected = ladder.METHODS if study is ladder else (*fusion_controls.METHODS, "fbql, never learned", "fbql")
    assert [method for method in told if method in expected] == list(expected)
    assert len({tuple(row) for row in rows if "method" in row}) == 1, "methods have other columns than others"
    assert {row["episodes"] for row in rows if "method" in row} == {2}
    pytest.importorskip("matplotlib", reason="it is in requirements-study.txt")
    for file in study.figures(results, tmp_path):
        assert file.stat().st_size < 100_000
        assert file.suffix == ".json" or file.read_text().startswith("<?xml")


@pytest.mark.usefixtures("short")
def test_more_behaviors_train_and_play_and_keep_only_what_they_met(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        scaling, "make_tree", lambda name, _seed: argparse.Namespace(tree=load_tree(shipped_trees() / f"{name}.json"))
    )
    results = {task.key: scaling.run(task.parameters) for task in tasks(scaling, *TINY)}
    rows = scaling.table(results)
    assert [row["behaviors"] for row in rows] == list(scaling.COUNTS)
    products = [row["leaf_product"] for row in rows]
    assert products == sorted(products)
    for row in rows:
        assert row["joint_states"] < row["leaf_product"]
        assert row["table_bytes"] == row["leaf_product"] * row["behaviors"] * 16
    assert rows[-1]["bytes"] < 1e-6 * rows[-1]["table_bytes"]
    pytest.importorskip("matplotlib", reason="it is in requirements-study.txt")
    assert [file.name for file in scaling.figures(results, tmp_path)] == ["curves.json", "fusion_scaling.svg"]


def test_each_number_of_behaviors_adds_to_the_smaller_one() -> None:
    names = [scaling.names_of(n) for n in scaling.COUNTS]
    assert [len(set(each)) for each in names] == list(scaling.COUNTS)
    assert all(more[: len(fewer)] == fewer for fewer, more in pairwise(names))


@pytest.mark.parametrize("study", VARIED)
def test_every_variant_changes_a_parameter_and_each_is_tried_once(study: ModuleType) -> None:
    default = FusionParameters()
    trained, played = study.VARIANTS.trained, study.VARIANTS.played
    assert not set(trained) & set(played)
    for changes in (*trained.values(), *played.values()):
        assert any(getattr(default, name) != value for name, value in changes.items())
    assert len({str(sorted(changes.items())) for changes in (*trained.values(), *played.values())}) == len(
        trained
    ) + len(played)
    assert all(name in ("fbql_play", "fbql_patience", "fbql_play_steps") for each in played.values() for name in each)


@pytest.mark.parametrize("changes", CHANGES.values(), ids=CHANGES)
def test_every_variant_can_be_trained_and_played(changes: variants.Changes, loop: WorldLoop) -> None:
    fusion = training_of(5, 3, **changes)
    trained = train(fusion, shipped(), loop)
    assert frozen(fusion, shipped(), loop, 77, 1, trained.policy)["episodes"] == 1


@pytest.mark.usefixtures("short")
def test_the_papers_protocol_tells_rung_a_ties_and_courses(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        paper, "make_tree", lambda name, _seed: argparse.Namespace(tree=load_tree(shipped_trees() / f"{name}.json"))
    )
    monkeypatch.setattr(paper, "MOST_EPISODES", 3)
    monkeypatch.setattr(paper, "GUIDED_EPISODES", 3)
    found = tasks(paper, *SMALL, "--seeds", "2", "--goals", "1")
    results = {task.key: paper.run({**task.parameters, "max_steps": 600}) for task in found}
    assert json.loads(json.dumps(results, allow_nan=False)) == results
    rows = paper.table(results)
    json.dumps(rows, allow_nan=False)
    methods = {row["method"]: row for row in rows if "method" in row}
    assert list(methods) == list(paper.METHODS)
    assert len({tuple(row) for row in methods.values()}) == 1
    assert methods["fbql literal, ties: none"]["tied_share"] > 0.9
    guides = ("", ", paper's guide")
    assert {row["rung"] for row in rows if "rung" in row} == {f"a, {each}{by}" for each in LEARNERS for by in guides}
    for learner in LEARNERS:
        assert methods[learner]["tied_share"] is None
        for by in guides:
            assert None not in (methods[f"{learner}{by}"]["p_guided"], methods[f"{learner}{by}"]["p_untrained"])
            assert any(f"'{learner}{by}, only guided'" in row.get("measure", "") for row in rows)
    for run in (run for result in results.values() for run in result["runs"]):
        assert len(run["course"]) == run["episodes"]
        assert sum(steps for _, steps, _, _ in run["course"]) == run["steps"]
    pytest.importorskip("matplotlib", reason="it is in requirements-study.txt")
    assert [file.name for file in paper.figures(results, tmp_path)] == ["curves.json", "fusion_paper.svg"]


def row(method: str, tree_seed: int, seed: int, steps: int, **figures: int) -> dict[str, Any]:
    counted = {"goals": 100, "own_goals": 0, "timeouts": 0, "episodes": 100, "collisions_begun": 100}
    counted |= {"collision_steps": 500, "steps_to_goals": steps, **figures}
    return {"method": method, "tree_seed": tree_seed, "seed": seed, "steps": steps, **counted}


def test_the_sensed_critic_alone_plays_the_twins_too() -> None:
    alone = tasks(ladder, *SMALL, "--learners", "fbql_sensed")
    assert alone[0].parameters["twins"]
    assert not any("twins" in task.parameters for task in tasks(ladder, *SMALL))
    result = ladder.run({**alone[0].parameters, "episodes": 3, "evaluate": 1})
    twins = ["fbql, never learned", "fbql, never learned, drawn", "fbql, only guided"]
    assert [run["method"] for run in result["runs"]] == [*twins, ladder.SENSED]


def ladder_of(learned: dict[int, int], learner: str = "fbql", **figures: int) -> dict[str, Result]:
    """Results of a ladder with two seeds on each tree set: re-tuned costs 1000, the law 300, a learner what is given."""
    results: dict[str, Result] = {}
    for tree, cost in learned.items():
        controls = [
            row(method, tree, seed, 100 * each)
            for method, each in ((fusion_controls.LAW, 300), (fusion_controls.RETUNED, 1000))
            for seed in range(2)
        ]
        results[f"controls{tree}"] = {"runs": controls, "thresholds": [0.07, 0.1], "leaves": [100, 10, 30]}
        runs = [row(learner, tree, seed, 100 * cost, **figures) for seed in range(2)]
        results[f"{learner}{tree}"] = {"runs": runs}
    return results


def rungs(results: dict[str, Result]) -> dict[str, tuple[float, bool]]:
    return {each["measure"]: (each["found"], each["reached"]) for each in ladder.table(results) if "rung" in each}


@pytest.mark.parametrize("learner", LEARNERS)
def test_rungs_b_and_c_are_reached_where_every_measure_is(learner: str) -> None:
    found = rungs(ladder_of({1001: 500, 1002: 700}, learner))
    assert found["cost/goal to re-tuned"] == (pytest.approx(0.6), True)
    assert found["cost/goal to re-tuned, worst tree set"] == (pytest.approx(0.7), True)
    assert found["steps of a success to the scripted law's"] == (pytest.approx(2.0), True)
    assert all(reached for _, reached in found.values())


@pytest.mark.parametrize(
    ("costs", "figures", "missed"),
    [
        ({1001: 700, 1002: 700}, {}, {"cost/goal to re-tuned", "steps of a success to the scripted law's"}),
        ({1001: 100, 1002: 1010}, {}, {"cost/goal to re-tuned, worst tree set"}),
        ({1001: 500}, {"own_goals": 1}, {"own goals / episodes"}),
        ({1001: 500}, {"collisions_begun": 101}, {"collisions begun / goals, at most re-tuned's"}),
        ({1001: 500}, {"collision_steps": 501}, {"collision steps / goals, at most re-tuned's"}),
        ({1001: 500}, {"episodes": 103}, {"success rate"}),
    ],
)
def test_a_rung_is_missed_where_one_measure_is(
    costs: dict[int, int], figures: dict[str, int], missed: set[str]
) -> None:
    found = rungs(ladder_of(costs, **figures))
    assert {measure for measure, (_, reached) in found.items() if not reached} == missed


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


def test_learning_curves_are_sums_over_runs_and_leave_out_what_has_no_goal() -> None:
    curve = [
        {"episodes": 100, "goals": 0, "steps": 400, "joint_states": 10},
        {"episodes": 50, "goals": 50, "steps": 100, "joint_states": 30},
    ]
    runs = {(1, seed): {"curve": curve, "size": {"leaf_product": 99}} for seed in range(3)}
    found = learning({"fbql": runs}, {})["trained"]["fbql"]
    assert found["episodes"] == [100, 150]
    assert found["cost"] == [[None, 2.0]] * 3
    assert found["success"] == [[0.0, 1.0]] * 3
    assert growth({"fbql": runs})["fbql"]["joint_states"] == [[10.0, 30.0]] * 3


@pytest.mark.parametrize("learner", LEARNERS)
def test_weight_maps_hold_the_weights_of_every_place_and_of_nothing_learned_equal_ones(
    learner: str, long_loop: WorldLoop
) -> None:
    fusion = training_of(5, 6, learner)
    trained = train(fusion, shipped(), long_loop)
    maps = weight_maps(fusion, trained.policy, shipped())
    weights = np.array(maps["weights"])
    assert weights.shape == (len(maps["headings_rad"]), len(maps["y_m"]), len(maps["x_m"]), 3)
    assert np.abs(weights.sum(axis=3) - 100).max() <= 2
    assert weights.std() > 1.0
    session_policy = trained.policy._replace(
        arrays={name: 0 * x if name in ("theta", "values") else x for name, x in trained.policy.arrays.items()}
    )
    assert (np.array(weight_maps(fusion, session_policy, shipped())["weights"]) == 33).all()


def test_one_worker_and_two_give_the_same_results_and_a_run_goes_on_where_one_was_stopped(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("matplotlib", reason="it is in requirements-study.txt")
    arguments = ["ladder", *TINY, "--max-steps", "5", "--json", "--out"]
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}
    try:
        for name, jobs in (("one", "1"), ("two", "2")):
            assert main([*arguments, str(tmp_path / name), "--jobs", jobs]) == 0
        one, two = (kept(tmp_path / name) for name in ("one", "two"))
        assert len(one) == 4
        assert one == two
        (tmp_path / "two" / "tasks" / "fbql-trees1001-seed0.json").unlink()
        controls = (tmp_path / "two" / "tasks" / "controls-trees1001-seeds1.json").stat().st_mtime_ns
        assert main([*arguments, str(tmp_path / "two"), "--jobs", "2"]) == 0
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
    assert kept(tmp_path / "two") == one
    assert (tmp_path / "two" / "tasks" / "controls-trees1001-seeds1.json").stat().st_mtime_ns == controls
    told = capsys.readouterr()
    assert "3 of 4 tasks are done already" in told.err
    tables = [json.loads(line)["table"] for line in told.out.splitlines()]
    for table in tables:
        sizes = [row for row in table if "trainings" in row]
        assert [row["learner"] for row in sizes] == list(ladder.TRAINED)
        assert all(row.pop("training_s") > 0.0 for row in sizes)
    assert tables[0] == tables[1] == tables[2]


def test_thresholds_are_chosen_in_rounds_that_the_cheapest_go_on_from(monkeypatch: pytest.MonkeyPatch) -> None:
    known = {(0.0, 0.0): (1.0, 9.0), (0.0, 1.0): (2.0, 5.0), (0.1, 0.0): (3.0, 4.0), (0.1, 1.0): (4.0, 0.0)}
    asked: list[tuple[tuple[float, float], int]] = []

    def cost(pair: tuple[float, float], _behaviors: object, _loop: object, episodes: int) -> float:
        asked.append((pair, episodes))
        return known[pair][episodes // 100]

    for name, value in {"WALL_M": (0.0, 0.1), "APPROACH_RAD": (0.0, 1.0), "_cost_with": cost}.items():
        monkeypatch.setattr(tuning, name, value)
    monkeypatch.setattr(tuning, "TUNING_ROUNDS", ((30, 3), (100, 1)))
    assert tuning.retuned([], WorldLoop()) == (0.1, 0.0)
    assert [episodes for _, episodes in asked] == [30] * 4 + [100] * 3


def test_each_tree_set_of_the_papers_protocol_is_tuned_for_in_one_task_and_no_run_is_played_twice() -> None:
    found = tasks(paper, "--trees", "3", "--seeds", "9")
    tuned = [task.parameters for task in found if task.parameters["part"] == RETUNED]
    assert [task["tree_seed"] for task in tuned] == [1001, 1002, 1003]
    assert all(task["run_seeds"] == list(range(1000, 1009)) for task in tuned)
    others = [task.parameters for task in found if task.parameters["part"] != RETUNED]
    played = [(task["tree_seed"], seed) for task in others for seed in task["run_seeds"]]
    assert sorted(played) == [(tree, seed) for tree in (1001, 1002, 1003) for seed in range(1000, 1009)]


def test_the_constant_blend_is_the_cheapest_of_the_grid_on_the_tuning_seed(monkeypatch: pytest.MonkeyPatch) -> None:
    costs = {(0.6, 0.0, 0.4): (90, 1), (0.4, 0.2, 0.4): (200, 3), (1.0, 0.0, 0.0): (10, 0)}
    asked: set[tuple[int, int]] = set()

    def played(weights: tuple[float, ...], _behaviors: object, _loop: object, seed: int, episodes: int) -> Result:
        asked.add((seed, episodes))
        steps, goals = costs.get(weights, (1000, 1))
        return {"steps": steps, "goals": goals}

    monkeypatch.setattr("fbql_studies.constant_blend.blend_played", played)
    assert best_blend(shipped(), WorldLoop()) == (0.4, 0.2, 0.4)
    assert asked == {(tuning.TUNING_SEED, episodes) for episodes, _ in BLEND_ROUNDS}


def test_equal_constant_weights_are_the_uniform_controller(loop: WorldLoop) -> None:
    found = blend_played((1 / 3,) * 3, shipped(), loop, 77, 3)
    assert found == frozen(FusionParameters(controller="uniform"), shipped(), loop, 77, 3)


def kept(directory: Path) -> dict[str, Any]:
    """The results of a study's tasks, but for what was measured."""
    found = {path.name: json.loads(path.read_text()) for path in (directory / "tasks").glob("*.json")}
    for result in found.values():
        result.pop(MEASURED, None)
    return found


@pytest.mark.parametrize("option", ["--trees", "--seeds", "--goals", "--max-steps"])
def test_the_papers_protocol_refuses_numbers_below_1_and_beyond_reason(option: str) -> None:
    for number in ("0", "99999999"):
        with pytest.raises(BadInput, match=f"{option} is {number}; it must be 1 to "):
            tasks(paper, *SMALL, option, number)


def test_the_papers_tree_sets_end_before_those_of_other_studies() -> None:
    assert (
        min(study.SEEDS.first_tree for study in (sensitivity, ablation, scaling))
        >= paper.FIRST_TREE_SEED + paper.MOST_TREE_SETS
    )


def test_changes_are_told_as_options_that_the_command_takes() -> None:
    changes = ablation.VARIANTS.trained["leaves and pairs of leaves only"] | {"fbql_mirror": False, "preset": "paper"}
    words = variants.as_set(changes)
    assert words == "--set fbql_pair_tilings=0 --set fbql_joint_tilings=0 --set fbql_mirror=false --set preset=paper"
    rows = [{"method": "no mirror", "changes": words}, {"method": "fbql", "changes": ""}]
    assert fusion_words.changes_told(rows) == {
        "what is changed": (["method", "changes"], [["no mirror", f"`{words}`"]])
    }


def test_a_single_run_is_compared_without_p_and_a_control_not_with_itself() -> None:
    def run(method: str, steps: int, seed: int) -> dict[str, object]:
        ends = {
            "episodes": 2000,
            "goals": 1999,
            "own_goals": 1,
            "timeouts": 0,
            "collisions_begun": 3,
            "collision_steps": 9,
        }
        return {"method": method, "tree_seed": 1, "seed": seed, "steps": steps, "steps_to_goals": steps, **ends}

    def told(seeds: int) -> dict[str, str]:
        runs = [run(method, steps, seed) for seed in range(seeds) for method, steps in (("fbql", 600), ("other", 900))]
        by_method = comparison.runs_by_method(runs, ["fbql", "other"])
        rows = [comparison.method_row(method, by_method, {"default": "fbql"}) for method in by_method]
        table = fusion_words.variant_tables(rows)["one change each"]
        at, rate = table.head.index("to default"), table.head.index("success rate")
        assert [line[rate] for line in table.body] == ["0.999", "0.999"], "one was missed"
        return {line[0]: line[at] for line in table.body}

    assert told(1) == {"fbql": "", "other": "1.50"}
    assert told(2) == {"fbql": "", "other": "1.50 (1.50 to 1.50), p .5"}


def test_a_single_run_is_drawn_without_an_interval_and_an_endless_one_as_an_arrow() -> None:
    pytest.importorskip("matplotlib", reason="it is in requirements-study.txt")
    from fbql_studies.fusion_figures import intervals_figure

    def lines(low: float | None, high: float | None) -> int:
        (axis,) = intervals_figure([{"method": "a", "r": 0.6, "r_low": low, "r_high": high}], "r", "x").axes
        return sum(1 for line in axis.lines if line.get_ydata()[0] == 0 and line.get_xdata()[0] != 1.0)

    assert [lines(None, None), lines(0.5, 0.7), lines(0.5, None)] == [1, 2, 3]
