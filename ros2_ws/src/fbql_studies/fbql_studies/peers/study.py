"""Peers: other methods in the same simulator with the same budget of simulated steps.

A learner trains with a training seed (below FIRST_RUN_SEED) and then plays frozen on the episodes of another seed, the same
ones for every method of a tree set and seed. What is tuned for a tree set is tuned on training episodes. Stable-Baselines3
and torch are an optional extra (`peers`): without them its rows read "not installed".
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from fbql.cli.output import say
from fbql.statistics.inference import Resamples
from fbql.statistics.runs import Runs, method_row, ratio, runs_by_method
from fbql.statistics.tables import Row, Table, mean_of, number
from fbql_behaviors.core.behavior import Behavior
from fbql_common.checkout import how_to_install
from fbql_common.core.errors import BadInput

from fbql_studies.common.fusion_tables import (
    METHOD_COLUMNS,
    SIZE_COLUMNS,
    adjusted_p_values,
    compared,
    cost,
    robust_table,
    share,
)
from fbql_studies.common.learning_curves import short
from fbql_studies.common.methods import CONSTANT, PAPER, RETUNED
from fbql_studies.common.play import Score
from fbql_studies.common.training import FIRST_RUN_SEED, FIRST_TREE_SEED, behaviors_of
from fbql_studies.runner.study import MEASURED, Parameters, Result, StudyTask, add_count, check_counts

DESCRIPTION = (
    "other methods on the same task, simulator and budget: Q-learning, PPO, constant weights, single behaviors"
)
CAPTIONS = {
    "fusion_peers": "What a goal costs and how many episodes end in one, frozen, with 95 % intervals over tree sets and runs",
    "fusion_peers_training": "Success rate in the course of the trainings, exploration included",
}
COLUMNS = {
    **METHOD_COLUMNS,
    "training_steps": SIZE_COLUMNS["training_steps"],
    "training_s": SIZE_COLUMNS["training_s"],
    "note": "how the frozen policy plays, or why there is none",
}
FIRST_TRAINING_SEED = 100
SEEDS_OF_A_TREE_SET = 100
MOST_TREE_SETS = (FIRST_RUN_SEED - FIRST_TRAINING_SEED) // SEEDS_OF_A_TREE_SET
CONTROLS = "controls"
EXTRA = "stable_baselines3"
NOT_INSTALLED = f"not installed: {how_to_install('peers')}"


def add_options(parser: argparse.ArgumentParser) -> None:
    """Adds the study's own options."""
    add_count(parser, "--seeds", 4, "training seeds of each tree set")
    add_count(parser, "--trees", 5, "tree sets, each from other demonstrations")
    add_count(parser, "--steps", 1_500_000, "simulated steps of each training")
    add_count(parser, "--episodes", 100, "episodes that each frozen policy is played on")


def tasks(options: argparse.Namespace) -> list[StudyTask]:
    """A task for the controls of each tree set, one for each learner, tree set and seed; learners that can't run are left out."""
    check_counts(options, seeds=SEEDS_OF_A_TREE_SET, trees=MOST_TREE_SETS, steps=2**62, episodes=2**31)
    if find_spec("gymnasium") is None:
        raise BadInput(f"the study of peers needs Gymnasium, which is not installed: {how_to_install('studies')}")
    from fbql_studies.peers.learners import LEARNERS, NEED_PPO

    learners = LEARNERS
    if find_spec(EXTRA) is None:
        learners = tuple(method for method in LEARNERS if method not in NEED_PPO)
        say(f"left out: {'; '.join(NEED_PPO)} ({NOT_INSTALLED})")
    sets = range(options.trees)
    given = {"steps": options.steps, "episodes": options.episodes}
    found = [
        StudyTask(
            f"{CONTROLS}-trees{FIRST_TREE_SEED + k}-seeds{options.seeds}",
            {"part": CONTROLS, "set": k, "seeds": options.seeds, **given},
        )
        for k in sets
    ]
    for method in learners:  # a study that is cut short has whole methods
        for seed in range(options.seeds):
            for k in sets:
                key = f"{method.replace(', ', '-').replace(' ', '_')}-trees{FIRST_TREE_SEED + k}-seed{seed}"
                found.append(StudyTask(key, {"part": method, "set": k, "seed": seed, **given}))
    return found


def run(parameters: Parameters) -> Result:
    """Trains and plays one learner, or plays all controls of a tree set."""
    tree_set, episodes = parameters["set"], parameters["episodes"]
    behaviors = behaviors_of(FIRST_TREE_SEED + tree_set)
    if parameters["part"] == CONTROLS:
        return _controls(parameters, behaviors)
    from fbql_studies.peers.learners import TrainingPlan, learn

    seed = parameters["seed"]
    training_seed = training_seed_of(tree_set, seed)
    plan = TrainingPlan(behaviors, parameters["steps"], training_seed, evaluation_seed_of(tree_set, seed), episodes)
    learned = learn(parameters["part"], plan)
    row = _run_row(parameters["part"], tree_set, seed, learned.score, learned.course.steps)
    row |= {"played": learned.played, "curve": learned.course.slices()}
    return {"runs": [row], MEASURED: {"training_s": learned.training_s}}


def _controls(parameters: Parameters, behaviors: Sequence[Behavior]) -> Result:
    from fbql_studies.peers.controls import Controls

    controls = Controls(behaviors, parameters["steps"])
    tree_set = parameters["set"]
    rows = [
        _run_row(method, tree_set, seed, score, controls.weights_steps if method == CONSTANT else 0)
        for seed in range(parameters["seeds"])
        for method, score in controls.play(evaluation_seed_of(tree_set, seed), parameters["episodes"]).items()
    ]
    return {"runs": rows, "thresholds": list(controls.thresholds), "weights": list(controls.weights)}


def training_seed_of(tree_set: int, seed: int) -> int:
    """The run seed of a training, below FIRST_RUN_SEED: another one for each tree set and seed."""
    return FIRST_TRAINING_SEED + tree_set * SEEDS_OF_A_TREE_SET + seed


def evaluation_seed_of(tree_set: int, seed: int) -> int:
    """The run seed of the frozen play, from FIRST_RUN_SEED on: another one for each tree set and seed."""
    return FIRST_RUN_SEED + training_seed_of(tree_set, seed)


def _run_row(method: str, tree_set: int, seed: int, score: Score, training_steps: int) -> dict[str, Any]:
    return {
        "method": method,
        "tree_seed": FIRST_TREE_SEED + tree_set,
        "seed": seed,
        "training_steps": training_steps,
        **score._asdict(),
    }


def table(results: Mapping[str, Result]) -> list[Row]:
    """Each method's frozen play, with intervals over runs, and paired with Subsumption on the same episodes."""
    from fbql_studies.peers.learners import NEED_PPO

    runs = runs_of(results)
    seconds: dict[str, list[float]] = {}
    for result in results.values():
        if MEASURED in result:
            seconds.setdefault(result["runs"][0]["method"], []).append(result[MEASURED]["training_s"])
    rows = [
        {
            **method_row(method, runs, {"retuned": RETUNED, "paper": PAPER}),
            "training_steps": mean_of([each["training_steps"] for each in by_run.values()]),
            "training_s": mean_of(seconds.get(method, [])),
            "note": ", ".join(sorted({each["played"] for each in by_run.values() if "played" in each})),
        }
        for method, by_run in runs.items()
    ]
    if results and find_spec(EXTRA) is None:
        missing = [method for method in NEED_PPO if method not in runs]
        rows += [{**dict.fromkeys(rows[0]), "method": each, "runs": 0, "note": NOT_INSTALLED} for each in missing]
    return rows


def words(rows: Sequence[Row]) -> dict[str, Table]:
    """Title -> table."""
    head = ["method", "runs", "goals / episodes", "own goals", "success rate", "cost/goal (95 %)", "contact steps / goal",
            "to re-tuned", "training [s]", "played"]  # fmt: skip
    controls = {"retuned": "re-tuned"}
    adjusted = adjusted_p_values(rows, "retuned")
    body = [
        [
            row["method"],
            str(row["runs"]),
            f"{row['goals']} / {row['episodes']}",
            str(row["own_goals"]),
            share(row["success_rate"]),
            cost(row),
            number(row["collision_steps_per_goal"], ".0f"),
            compared(row, "retuned", adjusted[row["method"]]),
            number(row["training_s"], ".0f"),
            row["note"],
        ]
        if row["runs"]
        else [row["method"], "0", *[""] * (len(head) - 3), row["note"]]
        for row in rows
    ]
    return {"the same budget": Table(head, body), **robust_table(rows, controls)}


def runs_of(results: Mapping[str, Result]) -> dict[str, Runs]:
    """Method -> (tree seed, seed) -> run, controls first."""
    from fbql_studies.peers.controls import METHODS
    from fbql_studies.peers.learners import LEARNERS

    return runs_by_method((run for result in results.values() for run in result["runs"]), (*METHODS, *LEARNERS))


def figures(results: Mapping[str, Result], directory: Path) -> list[Path]:
    """What each method costs, the course of the trainings, and the numbers they are drawn from (curves.json)."""
    if not results:
        return []
    from fbql_studies.common.drawing import keep_and_draw
    from fbql_studies.peers.figures import FIGURES

    runs = runs_of(results)
    curves: dict[str, Any] = {
        "peers": [
            {
                "method": method,
                "cost": short(ratio(by_run, "steps", "goals")),
                "success": short(ratio(by_run, "goals", "episodes")),
            }
            for method, by_run in runs.items()
        ]
    }
    trained = {method: by_run for method, by_run in runs.items() if all("curve" in run for run in by_run.values())}
    if trained:
        curves["peers_training"] = {method: _course(list(by_run.values())) for method, by_run in trained.items()}
    return keep_and_draw(FIGURES, curves, directory)


def _course(runs: Sequence[Mapping[str, Any]]) -> list[list[float | None]]:
    """Success rate in each slice of the budget, exploration included: estimates, lows and highs."""
    resamples = Resamples([run["tree_seed"] for run in runs])
    goals, episodes = (
        np.array([[part[name] for part in run["curve"]] for run in runs], dtype=np.float64)
        for name in ("goals", "episodes")
    )
    return [short(line) for line in resamples.ratio_band(goals, episodes).tolist()]
