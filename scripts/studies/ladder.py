"""The ladder: FBQL trained on fresh tree sets, then played frozen against its controls on the same unseen episodes.

A task is the training of one tree set and seed, or the controls of one tree set. Training, tuning and judging have run
seeds of their own.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from time import perf_counter
from typing import Any

from fbql_behaviors.core.behavior import Behavior
from fbql_sim.core.parameters import SimulationParameters
from fbql_sim.core.world_loop import WorldLoop

from studies import fusion_controls
from studies.comparison import Runs, method_row, runs_by_method
from studies.fusion_controls import LAW, PAPER, RETUNED, TUNED, control_tasks, controls_played
from studies.ladder_rungs import rung_rows, tree_rows
from studies.learning_curves import growth, learning
from studies.paper import FIRST_RUN_SEED, FIRST_TREE_SEED, after_guidance
from studies.study import MEASURED, Parameters, Result, Row, Task
from studies.training import Seeds, check_options, frozen, train, training_of
from studies.training import add_options as add_training_options
from studies.weight_maps import weight_maps

DESCRIPTION = (
    "fbql trained on fresh trees, then frozen against Subsumption, equal weights, its twins and the scripted law"
)
SEEDS = Seeds(FIRST_TREE_SEED, FIRST_RUN_SEED)
FBQL = "fbql"
UNTRAINED, DRAWN, GUIDED = "fbql, never learned", "fbql, never learned, drawn", "fbql, only guided"
METHODS = (*fusion_controls.METHODS, UNTRAINED, DRAWN, GUIDED, FBQL)
CONTROLS = {"retuned": RETUNED, "tuned": TUNED, "paper": PAPER, "untrained": UNTRAINED, "guided": GUIDED}


def add_options(parser: argparse.ArgumentParser) -> None:
    """Adds the study's own options."""
    add_training_options(parser, trees=5, seeds=5, episodes=3000, evaluate=200)


def tasks(options: argparse.Namespace) -> list[Task]:
    """A training for each tree set and seed, seed by seed, so that every tree set has one early; then the controls."""
    check_options(options)
    given = {"evaluate": options.evaluate, "max_steps": options.max_steps}
    found = [
        Task(
            f"fbql-trees{SEEDS.tree(k)}-seed{seed}",
            {"part": FBQL, "set": k, "seed": seed, "episodes": options.episodes, **given},
        )
        for seed in range(options.seeds)
        for k in range(options.trees)
    ]
    return found + control_tasks(SEEDS, options.trees, options.seeds, given)


def run(parameters: Parameters) -> Result:
    """Trains once and plays what was learned and its twins, or plays the controls of a tree set."""
    behaviors = SEEDS.behaviors(parameters["set"])
    loop = WorldLoop(SimulationParameters(max_steps=parameters["max_steps"]))
    if parameters["part"] != FBQL:
        return controls_played(SEEDS, parameters, behaviors, loop)
    return _trained(parameters, behaviors, loop)


def _trained(parameters: Parameters, behaviors: list[Behavior], loop: WorldLoop) -> Result:
    tree_set, seed = parameters["set"], parameters["seed"]
    fusion = training_of(SEEDS.training(seed), parameters["episodes"])
    begun_s = perf_counter()
    trained = train(fusion, behaviors, loop)
    training_s = perf_counter() - begun_s
    twins = {
        UNTRAINED: (fusion, None),
        DRAWN: (training_of(fusion.seed, fusion.episodes, fbql_play="drawn"), None),
        GUIDED: (fusion, after_guidance(fusion, behaviors, loop)),
        FBQL: (fusion, trained.policy),
    }
    judge, episodes = SEEDS.judging(tree_set, seed), parameters["evaluate"]
    begun_s = perf_counter()
    runs = [
        SEEDS.row(method, tree_set, seed, frozen(each, behaviors, loop, judge, episodes, policy))
        for method, (each, policy) in twins.items()
    ]
    seconds = {"training_s": training_s, "evaluation_s": perf_counter() - begun_s}
    result: Result = {"runs": runs, "curve": trained.curve, "size": trained.size, MEASURED: seconds}
    if tree_set == seed == 0:
        result["maps"] = weight_maps(fusion, trained.policy, behaviors)
    return result


def table(results: Mapping[str, Result]) -> list[Row]:
    """Methods; then tree sets; then the rungs that this study can tell of; then what was visited."""
    by_method = _runs(results)
    rows = [method_row(method, by_method, CONTROLS) for method in by_method]
    if FBQL in by_method and RETUNED in by_method:
        rows += tree_rows(by_method[FBQL], by_method[RETUNED], results)
        rows += rung_rows(by_method[FBQL], by_method[RETUNED], by_method[LAW])
    return rows + _sizes(results)


def _runs(results: Mapping[str, Result]) -> dict[str, Runs]:
    return runs_by_method((run for result in results.values() for run in result["runs"]), METHODS)


def _sizes(results: Mapping[str, Result]) -> list[Row]:
    """Means over the trainings."""
    trained = [result for result in results.values() if "size" in result]
    if not trained:
        return []
    names = ("features", "bytes", "joint_states", "leaf_product")
    row: Row = {"trainings": len(trained)}
    row |= {name: sum(each["size"][name] for each in trained) / len(trained) for name in names}
    row["training_steps"] = sum(part["steps"] for each in trained for part in each["curve"]) / len(trained)
    row["training_s"] = sum(each[MEASURED]["training_s"] for each in trained) / len(trained)
    return [row]


def figures(results: Mapping[str, Result], directory: Path) -> list[Path]:
    """Learning curves, the methods, coverage and weight maps, and the numbers they are drawn from (curves.json)."""
    trained = {
        (result["runs"][0]["tree_seed"], result["runs"][0]["seed"]): result
        for result in results.values()
        if "curve" in result
    }
    if not trained:
        return []
    from studies.fusion_figures import draw, write_curves

    by_method = _runs(results)
    curves: dict[str, Any] = {
        "learning": learning({FBQL: trained}, {name: by_method[name] for name in (RETUNED, LAW) if name in by_method}),
        "coverage": growth({FBQL: trained}),
    }
    if RETUNED in by_method:
        curves["ladder"] = [
            {name: row[name] for name in ("method", "ratio_retuned", "ratio_retuned_low", "ratio_retuned_high")}
            for row in table(results)
            if "method" in row
        ]
    maps = [result["maps"] for result in trained.values() if "maps" in result]
    if maps:
        curves["maps"] = maps[0]
    return [write_curves(curves, directory), *draw(curves, directory)]
