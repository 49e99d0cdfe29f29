"""The ladder, and what holds for every study that trains: seeds of their own, tasks that repeat, tables with every method."""

from __future__ import annotations

import json
import re
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from fbql_common.core.errors import BadInput
from fbql_sim.core.parameters import SimulationParameters
from fbql_sim.core.world_loop import WorldLoop
from fbql_studies.ablation import study as ablation
from fbql_studies.common import tuning
from fbql_studies.common.methods import CONTROLS, LAW, LEARNERS, RETUNED, TUNED_LAW
from fbql_studies.common.training import (
    FIRST_RUN_SEED,
    FIRST_TREE_SEED,
    MOST_TREE_SETS,
    SEEDS_OF_A_TREE_SET,
    train,
    training_of,
)
from fbql_studies.ladder import study as ladder
from fbql_studies.ladder.weight_maps import weight_maps
from fbql_studies.paper import study as paper
from fbql_studies.runner.study import MEASURED, Result
from fbql_studies.scaling import study as scaling
from fbql_studies.sensitivity import study as sensitivity
from own_controller import only_ours
from studies import make_imagination_short, make_short, shipped, tasks_of

TRAINING = (ladder, ablation, sensitivity, scaling)
STUDIES = (*TRAINING, paper)
VARIED = (ablation, sensitivity)
SMALL = ("--trees", "1", "--seeds", "1", "--max-steps", "120")
TINY = (*SMALL, "--episodes", "4", "--evaluate", "2")


@pytest.fixture
def short(monkeypatch: pytest.MonkeyPatch) -> None:
    make_short(monkeypatch)
    make_imagination_short(monkeypatch)
    monkeypatch.setattr("fbql_studies.ladder.weight_maps.SPACING_M", 0.4)


@pytest.mark.parametrize("study", STUDIES)
def test_tasks_are_plain_and_their_keys_are_unique_file_names(study: ModuleType) -> None:
    found = tasks_of(study, "--trees", "3", "--seeds", "9")
    assert len({task.key for task in found}) == len(found)
    assert all(re.fullmatch(r"[A-Za-z0-9._-]+", task.key) for task in found)
    assert json.loads(json.dumps([task.parameters for task in found])) == [task.parameters for task in found]


@pytest.mark.parametrize("study", TRAINING)
def test_numbers_out_of_range_are_refused(study: ModuleType) -> None:
    for option in ("--trees", "--seeds", "--episodes", "--evaluate", "--max-steps"):
        with pytest.raises(BadInput, match=f"^{option} is 0; it must be 1 to"):
            tasks_of(study, option, "0")


def test_no_study_shares_a_seed_or_a_tree_with_another_and_none_judges_what_it_trained_or_tuned_on() -> None:
    seeds, trees = set(range(FIRST_RUN_SEED)), set[int]()
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
    assert tuning.TUNING_SEED < FIRST_RUN_SEED


def test_the_papers_tree_sets_end_before_those_of_other_studies() -> None:
    assert (
        min(study.SEEDS.first_tree for study in (sensitivity, ablation, scaling))
        >= FIRST_TREE_SEED + paper.MOST_TREE_SETS
    )


@pytest.mark.usefixtures("short")
@pytest.mark.parametrize("study", [ladder, *VARIED])
def test_a_task_gives_the_same_result_again_and_the_table_has_every_method(study: ModuleType, tmp_path: Path) -> None:
    found = [task for task in tasks_of(study, *TINY) if task.parameters["part"] in (*ladder.TRAINED, "controls")]
    results: dict[str, Result] = {}
    for task in found:
        result = study.run(task.parameters)
        assert json.loads(json.dumps(result, allow_nan=False)) == result
        results[task.key] = result
    again = study.run(found[0].parameters)
    assert {**again, MEASURED: 0} == {**results[found[0].key], MEASURED: 0}
    rows = study.table(results)
    json.dumps(rows, allow_nan=False)
    told = [row["method"] for row in rows if "method" in row]
    expected = ladder.METHODS if study is ladder else (*CONTROLS, "fbql, never learned", "fbql")
    assert [method for method in told if method in expected] == list(expected)
    assert len({tuple(row) for row in rows if "method" in row}) == 1, "methods have other columns than others"
    assert {row["episodes"] for row in rows if "method" in row} == {2}
    pytest.importorskip("matplotlib", reason="it is in requirements/study.txt")
    for file in study.figures(results, tmp_path):
        assert file.stat().st_size < 100_000
        assert file.suffix == ".json" or file.read_text().startswith("<?xml")


@pytest.mark.usefixtures("short")
def test_the_sensed_critic_alone_plays_the_twins_too() -> None:
    alone = tasks_of(ladder, *SMALL, "--learners", "fbql_sensed")
    assert alone[0].parameters["twins"]
    assert not any("twins" in task.parameters for task in tasks_of(ladder, *SMALL))
    result = ladder.run({**alone[0].parameters, "episodes": 3, "evaluate": 1})
    twins = ["fbql, never learned", "fbql, never learned, drawn", "fbql, only guided"]
    assert [run["method"] for run in result["runs"]] == [*twins, ladder.SENSED]


def row(method: str, tree_seed: int, seed: int, steps: int, **figures: int) -> dict[str, Any]:
    counted = {"goals": 100, "own_goals": 0, "timeouts": 0, "episodes": 100, "collisions_begun": 100}
    counted |= {"collision_steps": 500, "steps_to_goals": steps, **figures}
    return {"method": method, "tree_seed": tree_seed, "seed": seed, "steps": steps, **counted}


OWN = """
class Always:
    def __init__(self, parameters, generator): pass
    def begin_episode(self, phase): pass
    def select(self, world, joint_state, outputs): return (1.0, 0.0, 0.0), 0, (), ()
"""


@pytest.mark.usefixtures("short")
def test_a_controller_of_ones_own_takes_part(tmp_path: Path) -> None:
    (tmp_path / "own.py").write_text(OWN)
    asked = ("--learners", "fbql_value", "--controllers", f"{tmp_path / 'own.py'}:Always")
    with only_ours():
        found = {task.key: task.parameters for task in tasks_of(ladder, *TINY, *asked)}
        assert re.fullmatch("own-Always-[0-9a-f]{12}-trees1001-seed0", list(found)[-1])
        results = {key: ladder.run(each) for key, each in found.items() if not key.startswith("fbql")}
        rows = ladder.table(results)
    assert next(row for row in rows if row.get("method") == "Always")["ratio_retuned"] is None
    assert any(row.get("rung") == "b, Always" for row in rows)
    assert ladder.words(rows)["size"].body[0][:3] == ["Always", "1", "0"]


@pytest.mark.usefixtures("short")
def test_controllers_of_one_name_share_no_result_and_an_edited_file_is_another_one(tmp_path: Path) -> None:
    files = [tmp_path / "a.py", tmp_path / "b.py"]
    for driver, file in enumerate(files):
        file.write_text(OWN.replace("0.0), 0,", f"0.0), {driver},"))
    asked = ("--learners", "fbql_value", "--controllers", str(files[0]), f"{files[1]}:Always", str(files[0]))
    with only_ours():
        first, second = (task for task in tasks_of(ladder, *TINY, *asked) if task.key.startswith("own"))
        assert first.key != second.key
        played = [ladder.run(task.parameters) for task in (first, second)]
        methods = [result["runs"][0]["method"] for result in played]
        assert methods == [f"Always {task.parameters['sha256']}" for task in (first, second)]
        one, other = ({**result["runs"][0], "method": ""} for result in played)
        assert one != other, "each drives by its own behavior"

        files[0].write_text(files[0].read_text() + "# edited\n")
        with pytest.raises(BadInput, match=r"a\.py:Always: it has changed since its tasks were made"):
            ladder.run(first.parameters)
        again = [task.key for task in tasks_of(ladder, *TINY, *asked) if task.key.startswith("own")]
        assert first.key not in again and second.key in again


def ladder_of(learned: dict[int, int], learner: str = "fbql", **figures: int) -> dict[str, Result]:
    """Results of a ladder with two seeds on each tree set: re-tuned costs 1000, the law 300, a learner what is given."""
    results: dict[str, Result] = {}
    for tree, cost in learned.items():
        controls = [
            row(method, tree, seed, 100 * each) for method, each in ((LAW, 300), (RETUNED, 1000)) for seed in range(2)
        ]
        results[f"controls{tree}"] = {"runs": controls, "thresholds": [0.07, 0.1], "leaves": [100, 10, 30]}
        runs = [row(learner, tree, seed, 100 * cost, **figures) for seed in range(2)]
        results[f"{learner}{tree}"] = {"runs": runs}
    return results


@pytest.mark.usefixtures("short")
def test_checkpoints_are_played_frozen_on_the_episodes_of_the_others_and_the_last_is_the_policy_in_the_end() -> None:
    asked = ("--learners", "fbql", "--checkpoints", "4", "2", "--first-trees", "1021", "--first-seed", "2000")
    task = tasks_of(ladder, *TINY, *asked)[0]
    assert (task.key, task.parameters["checkpoints"]) == ("fbql-trees1021-seed0", [2, 4])
    result = ladder.run(task.parameters)
    two, four = result["checkpoints"]
    assert (two["trained"], four["trained"], two["tree_seed"]) == (2, 4, 1021)
    assert 0 < two["trained_s"] < four["trained_s"]
    end = next(run for run in result["runs"] if run["method"] == "fbql")
    assert {name: four[name] for name in end} == end
    for wrong in ("0", "5"):
        with pytest.raises(BadInput, match=f"--checkpoints has {wrong}; it must be 1 to the training's 4 episodes"):
            tasks_of(ladder, *TINY, "--checkpoints", wrong)


def test_a_policy_at_a_checkpoint_has_what_is_learned_before_the_next_episode() -> None:
    fusion = training_of(5, 3, "fbql", guided=1, fbql_batch_episodes=1)
    loop = WorldLoop(SimulationParameters(max_steps=300))
    longer = train(fusion, shipped(), loop, [2]).checkpoints[2]
    alone = train(training_of(5, 2, "fbql", guided=1, fbql_batch_episodes=1), shipped(), loop, [2])
    assert alone.policy is not None
    m = len(alone.policy.arrays["theta"])
    assert np.array_equal(longer.policy.arrays["theta"][:m], alone.policy.arrays["theta"])
    assert longer.steps == alone.checkpoints[2].steps


def checkpoint(trained: int, tree: int, cost: int) -> dict[str, Any]:
    return {**row("fbql", tree, 0, 100 * cost), "trained": trained, "trained_s": 6.0 * trained}


def test_a_control_is_reached_from_the_first_checkpoint_on_after_which_it_is_never_missed() -> None:
    results = ladder_of({1001: 400, 1002: 400})
    costs = {50: 900, 200: 1100, 500: 800, 1000: 290, 3000: 310}
    for tree in (1001, 1002):
        results[f"fbql{tree}"]["checkpoints"] = [checkpoint(trained, tree, cost) for trained, cost in costs.items()]
    rows = ladder.table(results)
    reached = {each["target"]: each for each in rows if "target" in each}
    assert (reached[RETUNED]["reached_after"], reached[RETUNED]["reached_minutes"]) == (500, 50.0)
    assert (reached[LAW]["reached_after"], reached[LAW]["reached_minutes"]) == (None, None)
    assert (reached[RETUNED]["trainings_there"], reached[LAW]["trainings_there"]) == (2, 0)
    curve = [each for each in rows if "checkpoint" in each]
    assert [each["checkpoint"] for each in curve] == list(costs)
    assert curve[0]["ratios"][RETUNED][0] == pytest.approx(0.9)
    words = ladder.words(rows)
    assert words["frozen in the course of the training"].body[1][:4] == ["fbql", "200", "20.0", "1100 (1100 to 1100)"]
    assert [line[2] for line in words["how long it takes to reach the controls"].body] == ["500", "not reached"]


def test_learners_are_set_against_both_laws_and_the_kinematic_bounds() -> None:
    results = ladder_of({1001: 300, 1002: 300})
    for tree in (1001, 1002):
        tuned = [row(TUNED_LAW, tree, seed, 15_000) for seed in range(2)]
        bounds = [{"method": "kicked", "tree_seed": tree, "seed": 0, "steps": 700, "episodes": 10}]
        results[f"controls{tree}"]["runs"] += tuned
        results[f"controls{tree}"]["bounds"] = bounds
    rows = ladder.table(results)
    found = {each["yardstick"]: (each["steps"], each["times"]["fbql"]) for each in rows if "yardstick" in each}
    assert found == {LAW: (300.0, 1.0), TUNED_LAW: (150.0, 2.0), "kinematic bound, ball kicked": (70.0, 300 / 70)}
    assert rungs(results)["steps of a success to the tuned law's"] == (pytest.approx(2.0), False)
    assert ladder.words(rows)["yardsticks"].body[1] == [TUNED_LAW, "150.0", "2.00"]


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


@pytest.mark.parametrize("learner", LEARNERS)
def test_weight_maps_hold_the_weights_of_every_place_and_of_nothing_learned_equal_ones(
    learner: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("fbql_studies.ladder.weight_maps.SPACING_M", 0.4)
    fusion = training_of(5, 6, learner, guided=8)
    trained = train(fusion, shipped(), WorldLoop(SimulationParameters(max_steps=1000)))
    maps = weight_maps(fusion, trained.policy, shipped())
    weights = np.array(maps["weights"])
    assert weights.shape == (len(maps["headings_rad"]), len(maps["y_m"]), len(maps["x_m"]), 3)
    assert np.abs(weights.sum(axis=3) - 100).max() <= 2
    assert weights.std() > 1.0
    session_policy = trained.policy._replace(
        arrays={name: 0 * x if name in ("theta", "values") else x for name, x in trained.policy.arrays.items()}
    )
    assert (np.array(weight_maps(fusion, session_policy, shipped())["weights"]) == 33).all()
