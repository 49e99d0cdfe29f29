"""Peers: other methods in the same simulator with the same budget of simulated steps.

A learner trains with a training seed (below FIRST_RUN_SEED) and then plays frozen on the episodes of another seed, the same
ones for every method of a tree set and seed. What is tuned for a tree set is tuned on training episodes. The settings of
PPO are tuned on tree sets and episodes of their own. Stable-Baselines3 and torch are an optional extra (`peers`): without
them its rows read "not installed".
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
from fbql.statistics.tables import Row, Table, finite, mean_of, number, tabulate
from fbql_behaviors.core.behavior import Behavior
from fbql_common.checkout import how_to_install
from fbql_common.core.errors import BadInput

from fbql_studies.common.fusion_tables import (
    METHOD_COLUMNS,
    SIZE_COLUMNS,
    adjusted_p_values,
    compared,
    control_columns,
    cost,
    robust_table,
    share,
)
from fbql_studies.common.learning_curves import short
from fbql_studies.common.methods import CONSTANT, FBQL, PAPER, RETUNED
from fbql_studies.common.play import Score
from fbql_studies.common.training import FIRST_RUN_SEED, Seeds, add_first_seeds, behaviors_of, check_first_seeds
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
    **control_columns("before", "the method before it in the table of what makes the difference"),
    **control_columns("fbql", "fbql, trained with the same budget"),
    "setting": "number of a setting of PPO that was tried on training seeds, on tree sets of their own",
    "critic": "whether PPO's critic sees what fbql's critic sees (informed) or what the behaviors sense",
    "chosen": "whether the methods above were played with this setting",
    "tried": "the setting",
}
SEEDS = Seeds(1601, 13_000)
"""Used by no other study. The peers were first measured on those of the ladder."""
FIRST_TRAINING_SEED = 100
SEEDS_OF_A_TREE_SET = 100
MOST_TREE_SETS = (FIRST_RUN_SEED - FIRST_TRAINING_SEED) // SEEDS_OF_A_TREE_SET
CONTROLS, TUNING = "controls", "tuning"
TUNING_TREES = (901, 902)
"""Demonstration seeds of the tree sets on which settings of PPO are tried."""
FIRST_TUNING_SEED, FIRST_CHOOSING_SEED = 60, 80
"""Run seeds, on the first of these tree sets, of the trainings and of the episodes by which settings are compared."""
MOST_SETTINGS = 1000
CRITICS = {"sensed": False, "informed": True}
"""Critic -> whether it is informed."""
EXTRA = "stable_baselines3"
NOT_INSTALLED = f"not installed: {how_to_install('peers')}"


def add_options(parser: argparse.ArgumentParser) -> None:
    """Adds the study's own options."""
    add_count(parser, "--seeds", 4, "training seeds of each tree set")
    add_count(parser, "--trees", 5, "tree sets, each from other demonstrations")
    add_count(parser, "--steps", 1_500_000, "simulated steps of each training")
    add_count(parser, "--episodes", 100, "episodes that each frozen policy is played on")
    add_count(parser, "--settings", 16, "settings of PPO that are tried on training seeds, with each critic")
    add_first_seeds(parser, *SEEDS)


def tasks(options: argparse.Namespace) -> list[StudyTask]:
    """The settings of PPO, a task for the controls of each tree set, one for each learner, tree set and seed; learners that
    can't run are left out."""
    check_counts(
        options, seeds=SEEDS_OF_A_TREE_SET, trees=MOST_TREE_SETS, steps=2**62, episodes=2**31, settings=MOST_SETTINGS
    )
    check_first_seeds(options)
    if find_spec("gymnasium") is None:
        raise BadInput(f"the study of peers needs Gymnasium, which is not installed: {how_to_install('studies')}")
    from fbql_studies.peers.learners import LEARNERS, NEED_PPO

    learners = LEARNERS
    sets = range(options.trees)
    given: Parameters = {"steps": options.steps, "episodes": options.episodes}
    found: list[StudyTask] = []
    if find_spec(EXTRA) is None:
        learners = tuple(method for method in LEARNERS if method not in NEED_PPO)
        say(f"left out: {'; '.join(NEED_PPO)} ({NOT_INSTALLED})")
    else:
        found += [
            StudyTask(
                f"{TUNING}-setting{setting}-{critic}-trees{tree}",
                {"part": TUNING, "setting": setting, "critic": critic, "set": k, **given},
            )
            for setting in range(options.settings)
            for critic in CRITICS
            for k, tree in enumerate(TUNING_TREES)
        ]
    seeds = Seeds(options.first_trees, options.first_seed)
    given["seeds_from"] = list(seeds)
    found += [
        StudyTask(
            f"{CONTROLS}-trees{seeds.tree(k)}-seeds{options.seeds}",
            {"part": CONTROLS, "set": k, "seeds": options.seeds, **given},
        )
        for k in sets
    ]
    for method in learners:  # a study that is cut short has whole methods
        for seed in range(options.seeds):
            for k in sets:
                key = f"{_key_of(method)}-trees{seeds.tree(k)}-seed{seed}"
                found.append(StudyTask(key, {"part": method, "set": k, "seed": seed, **given}))
    return found


def _key_of(method: str) -> str:
    """How the keys of a method's tasks begin. A tuned one is trained again when the tuning has chosen another setting."""
    from fbql_studies.peers.fair_ppo import TUNED_PPO, TUNED_SENSED_PPO, tuned

    key = method.replace(", ", "-").replace(" ", "_")
    return f"{key}{tuned(method == TUNED_PPO)}" if method in (TUNED_PPO, TUNED_SENSED_PPO) else key


def run(parameters: Parameters) -> Result:
    """Tries a setting of PPO, or trains and plays one learner, or plays all controls of a tree set."""
    if parameters["part"] == TUNING:
        return _setting(parameters)
    tree_set, episodes, seeds = parameters["set"], parameters["episodes"], Seeds(*parameters["seeds_from"])
    behaviors = behaviors_of(seeds.tree(tree_set))
    if parameters["part"] == CONTROLS:
        return _controls(seeds, parameters, behaviors)
    from fbql_studies.peers.learners import TrainingPlan, learn

    seed = parameters["seed"]
    evaluation_seed = evaluation_seed_of(seeds, tree_set, seed)
    plan = TrainingPlan(behaviors, parameters["steps"], training_seed_of(tree_set, seed), evaluation_seed, episodes)
    learned = learn(parameters["part"], plan)
    row = _run_row(parameters["part"], seeds.tree(tree_set), seed, learned.score, learned.course.steps)
    row |= {"played": learned.played, "curve": learned.course.slices()}
    return {"runs": [row], MEASURED: {"training_s": learned.training_s}}


def _setting(parameters: Parameters) -> Result:
    """One of the settings of PPO, trained on a tree set and played on training episodes."""
    from fbql_studies.peers.learners import TrainingPlan, learn_setting

    k, setting, critic = parameters["set"], parameters["setting"], parameters["critic"]
    seeds = FIRST_TUNING_SEED + k, FIRST_CHOOSING_SEED + k
    plan = TrainingPlan(behaviors_of(TUNING_TREES[k]), parameters["steps"], *seeds, parameters["episodes"])
    learned = learn_setting(setting, CRITICS[critic], plan)
    tried = {"setting": setting, "critic": critic, "training_steps": learned.course.steps, **learned.score._asdict()}
    return {"tried": tried, MEASURED: {"training_s": learned.training_s}}


def _controls(seeds: Seeds, parameters: Parameters, behaviors: Sequence[Behavior]) -> Result:
    from fbql_studies.peers.controls import Controls

    controls = Controls(behaviors, parameters["steps"])
    tree_set = parameters["set"]
    rows = [
        _run_row(method, seeds.tree(tree_set), seed, score, controls.weights_steps if method == CONSTANT else 0)
        for seed in range(parameters["seeds"])
        for method, score in controls.play(evaluation_seed_of(seeds, tree_set, seed), parameters["episodes"]).items()
    ]
    return {"runs": rows, "thresholds": list(controls.thresholds), "weights": list(controls.weights)}


def training_seed_of(tree_set: int, seed: int) -> int:
    """The run seed of a training, below FIRST_RUN_SEED: another one for each tree set and seed."""
    return FIRST_TRAINING_SEED + tree_set * SEEDS_OF_A_TREE_SET + seed


def evaluation_seed_of(seeds: Seeds, tree_set: int, seed: int) -> int:
    """The run seed of the frozen play, from FIRST_RUN_SEED on: another one for each tree set and seed."""
    return seeds.first_run + training_seed_of(tree_set, seed)


def _run_row(method: str, tree_seed: int, seed: int, score: Score, training_steps: int) -> dict[str, Any]:
    return {
        "method": method,
        "tree_seed": tree_seed,
        "seed": seed,
        "training_steps": training_steps,
        **score._asdict(),
    }


def table(results: Mapping[str, Result]) -> list[Row]:
    """Each method's frozen play, with intervals over runs, and paired with Subsumption on the same episodes; then the
    settings of PPO."""
    from fbql_studies.peers.fair_ppo import BEFORE
    from fbql_studies.peers.learners import NEED_PPO

    runs = runs_of(results)
    seconds: dict[str, list[float]] = {}
    for result in results.values():
        if MEASURED in result and "runs" in result:
            seconds.setdefault(result["runs"][0]["method"], []).append(result[MEASURED]["training_s"])
    controls = {"retuned": RETUNED, "paper": PAPER, "fbql": FBQL}
    rows = [
        {
            **method_row(method, runs, controls | {"before": BEFORE.get(method, "")}),
            "training_steps": mean_of([each["training_steps"] for each in by_run.values()]),
            "training_s": mean_of(seconds.get(method, [])),
            "note": ", ".join(sorted({each["played"] for each in by_run.values() if "played" in each})),
        }
        for method, by_run in runs.items()
    ]
    if runs and find_spec(EXTRA) is None:
        missing = [method for method in NEED_PPO if method not in runs]
        rows += [{**dict.fromkeys(rows[0]), "method": each, "runs": 0, "note": NOT_INSTALLED} for each in missing]
    return rows + _setting_rows(results)


def _setting_rows(results: Mapping[str, Result]) -> list[Row]:
    """The settings of PPO that were tried, those with each critic by their cost."""
    from fbql_studies.peers.fair_ppo import tuned
    from fbql_studies.peers.ppo_settings import as_text, setting

    found: dict[tuple[str, int], list[Result]] = {}
    for result in results.values():
        if "tried" in result:
            found.setdefault((result["tried"]["critic"], result["tried"]["setting"]), []).append(result)
    rows: list[Row] = []
    for (critic, tried), own in found.items():
        total = {name: sum(each["tried"][name] for each in own) for name in ("goals", "episodes", "steps")}
        steps = total.pop("steps")
        row = {
            "setting": tried,
            "critic": critic,
            "runs": len(own),
            **total,
            "cost_per_goal": steps / total["goals"] if total["goals"] else float("inf"),
            "training_s": mean_of([each[MEASURED]["training_s"] for each in own]),
            "chosen": tried == tuned(CRITICS[critic]),
            "tried": as_text(setting(tried)),
        }
        rows.append(row)
    rows.sort(key=lambda row: ([*CRITICS].index(row["critic"]), row["cost_per_goal"], row["setting"]))
    return [finite(row) for row in rows]


def words(rows: Sequence[Row]) -> dict[str, Table]:
    """Title -> table."""
    from fbql_studies.peers.fair_ppo import STEPS

    tried = [row for row in rows if "setting" in row]
    rows = [row for row in rows if "method" in row]
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
    steps = [row for row in rows if row["runs"] and row["method"] in STEPS]
    return {
        "the same budget": Table(head, body),
        **({"PPO with what fbql has": _steps_table(steps)} if steps else {}),
        **robust_table(rows, controls),
        **({"settings of PPO, on training seeds": _settings_table(tried)} if tried else {}),
    }


def _steps_table(rows: Sequence[Row]) -> Table:
    """What each part makes of the method before it."""
    before, fbql = (adjusted_p_values(rows, name) for name in ("before", "fbql"))
    return tabulate(
        rows,
        {
            "method": lambda row: row["method"],
            "success rate": lambda row: share(row["success_rate"]),
            "cost/goal (95 %)": cost,
            "to the row before": lambda row: compared(row, "before", before[row["method"]]),
            "to fbql": lambda row: compared(row, "fbql", fbql[row["method"]]),
            "played": lambda row: row["note"],
        },
    )


def _settings_table(rows: Sequence[Row]) -> Table:
    return tabulate(
        rows,
        {
            "critic": lambda row: row["critic"],
            "setting": lambda row: f"{row['setting']}{', chosen' if row['chosen'] else ''}",
            "goals / episodes": lambda row: f"{row['goals']} / {row['episodes']}",
            "cost/goal": lambda row: number(row["cost_per_goal"], ".0f"),
            "training [s]": lambda row: number(row["training_s"], ".0f"),
            "what it is": lambda row: row["tried"],
        },
    )


def runs_of(results: Mapping[str, Result]) -> dict[str, Runs]:
    """Method -> (tree seed, seed) -> run, controls first."""
    from fbql_studies.peers.controls import METHODS
    from fbql_studies.peers.learners import LEARNERS

    found = (run for result in results.values() for run in result.get("runs", []))
    return runs_by_method(found, (*METHODS, *LEARNERS))


def figures(results: Mapping[str, Result], directory: Path) -> list[Path]:
    """What each method costs, the course of the trainings, and the numbers they are drawn from (curves.json)."""
    from fbql_studies.common.drawing import keep_and_draw
    from fbql_studies.peers.figures import FIGURES

    runs = runs_of(results)
    if not runs:
        return []
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
