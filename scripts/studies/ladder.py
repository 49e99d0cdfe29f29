"""The ladder: FBQL trained on fresh tree sets, then played frozen against its controls on the same unseen episodes.

A task is the training of one tree set and seed, or the controls of one tree set. Training, tuning and judging have run
seeds of their own: TUNING_SEED tunes, training_seed_of trains, evaluation_seed_of judges.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from time import perf_counter

from fbql_behaviors.core.behavior import Behavior
from fbql_common.core.errors import BadInput
from fbql_fusion.core.parameters import FusionParameters
from fbql_sim.core.parameters import SimulationParameters
from fbql_sim.core.world_loop import WorldLoop
from launcher.make_trees import make_tree

from studies.comparison import method_row, runs_by_method
from studies.ladder_rungs import rung_rows, tree_rows
from studies.paper import BEHAVIORS, FIRST_RUN_SEED, FIRST_TREE_SEED, after_guidance, retuned
from studies.peers import MOST_TREE_SETS, SEEDS_OF_A_TREE_SET, evaluation_seed_of
from studies.study import MEASURED, Parameters, Result, Row, Task
from studies.training import frozen, law_played, train, training_of

DESCRIPTION = (
    "fbql trained on fresh trees, then frozen against Subsumption, equal weights, its twins and the scripted law"
)
LAW, UNIFORM = "scripted law, sees all", "uniform weights"
PAPER, TUNED, RETUNED = "subsumption, paper", "subsumption, tuned", "subsumption, re-tuned"
FBQL = "fbql"
UNTRAINED, DRAWN, GUIDED = "fbql, never learned", "fbql, never learned, drawn", "fbql, only guided"
METHODS = (LAW, PAPER, TUNED, RETUNED, UNIFORM, UNTRAINED, DRAWN, GUIDED, FBQL)
CONTROLS = {"retuned": RETUNED, "tuned": TUNED, "paper": PAPER, "untrained": UNTRAINED, "guided": GUIDED}


def add_options(parser: argparse.ArgumentParser) -> None:
    """Adds the study's own options."""
    parser.add_argument("--trees", type=int, default=5, metavar="N", help="tree sets, each of other demonstrations (5)")
    parser.add_argument("--seeds", type=int, default=5, metavar="N", help="trainings on each tree set (5)")
    parser.add_argument(
        "--episodes", type=int, default=3000, metavar="N", help="training episodes after the guided ones (3000)"
    )
    parser.add_argument("--evaluate", type=int, default=200, metavar="N", help="episodes of frozen play (200)")
    most = SimulationParameters().max_steps
    parser.add_argument(
        "--max-steps", type=int, default=most, metavar="N", help=f"steps after which an episode is truncated ({most})"
    )


def check(options: argparse.Namespace) -> None:
    """Raises BadInput for a number out of range."""
    limits = {"trees": MOST_TREE_SETS, "seeds": SEEDS_OF_A_TREE_SET}
    for name in ("trees", "seeds", "episodes", "evaluate", "max_steps"):
        found, most = getattr(options, name), limits.get(name, 1_000_000)
        if not 1 <= found <= most:
            raise BadInput(f"--{name.replace('_', '-')} is {found}; it must be 1 to {most}")


def tasks(options: argparse.Namespace) -> list[Task]:
    """A training for each tree set and seed, seed by seed, so that every tree set has one early; then the controls."""
    check(options)
    given = {"evaluate": options.evaluate, "max_steps": options.max_steps}
    found = [
        Task(
            f"fbql-trees{FIRST_TREE_SEED + k}-seed{seed}",
            {"set": k, "seed": seed, "episodes": options.episodes, **given},
        )
        for seed in range(options.seeds)
        for k in range(options.trees)
    ]
    return found + [
        Task(f"controls-trees{FIRST_TREE_SEED + k}", {"set": k, "seeds": options.seeds, **given})
        for k in range(options.trees)
    ]


def training_seed_of(seed: int) -> int:
    """The run seed of a training: below those that judge, and none that a setting was chosen on."""
    return FIRST_RUN_SEED + seed


def behaviors_of(tree_set: int) -> list[Behavior]:
    """The behaviors of a tree set."""
    return [Behavior(name, make_tree(name, FIRST_TREE_SEED + tree_set).tree) for name in BEHAVIORS]


def run(parameters: Parameters) -> Result:
    """Trains once and plays what was learned and its twins, or plays the controls of a tree set."""
    behaviors = behaviors_of(parameters["set"])
    loop = WorldLoop(SimulationParameters(max_steps=parameters["max_steps"]))
    return (_trained if "seed" in parameters else _controls)(parameters, behaviors, loop)


def _trained(parameters: Parameters, behaviors: list[Behavior], loop: WorldLoop) -> Result:
    tree_set, seed = parameters["set"], parameters["seed"]
    fusion = training_of(training_seed_of(seed), parameters["episodes"])
    begun_s = perf_counter()
    trained = train(fusion, behaviors, loop)
    training_s = perf_counter() - begun_s
    twins = {
        UNTRAINED: (fusion, None),
        DRAWN: (training_of(fusion.seed, fusion.episodes, fbql_play="drawn"), None),
        GUIDED: (fusion, after_guidance(fusion, behaviors, loop)),
        FBQL: (fusion, trained.policy),
    }
    judge, episodes = evaluation_seed_of(tree_set, seed), parameters["evaluate"]
    begun_s = perf_counter()
    runs = [
        run_row(method, tree_set, seed, frozen(each, behaviors, loop, judge, episodes, policy))
        for method, (each, policy) in twins.items()
    ]
    seconds = {"training_s": training_s, "evaluation_s": perf_counter() - begun_s}
    return {"runs": runs, "curve": trained.curve, "size": trained.size, MEASURED: seconds}


def _controls(parameters: Parameters, behaviors: list[Behavior], loop: WorldLoop) -> Result:
    tree_set, episodes = parameters["set"], parameters["evaluate"]
    wall_m, approach_rad = retuned(behaviors, loop)
    controls = {
        PAPER: FusionParameters(controller="subsumption", preset="paper"),
        TUNED: FusionParameters(controller="subsumption", preset="tuned"),
        RETUNED: FusionParameters(
            controller="subsumption", wall_threshold_m=wall_m, approach_threshold_rad=approach_rad
        ),
        UNIFORM: FusionParameters(controller="uniform"),
    }
    runs: list[Row] = []
    for seed in range(parameters["seeds"]):
        judge = evaluation_seed_of(tree_set, seed)
        runs.append(run_row(LAW, tree_set, seed, law_played(loop, judge, episodes)))
        for method, fusion in controls.items():
            runs.append(run_row(method, tree_set, seed, frozen(fusion, behaviors, loop, judge, episodes)))
    leaves = [behavior.tree.leaf_count for behavior in behaviors]
    return {"runs": runs, "thresholds": [wall_m, approach_rad], "leaves": leaves}


def run_row(method: str, tree_set: int, seed: int, figures: Result) -> Row:
    """A run as it is kept."""
    return {"method": method, "tree_seed": FIRST_TREE_SEED + tree_set, "seed": seed, **figures}


def table(results: Mapping[str, Result]) -> list[Row]:
    """Methods; then tree sets; then the rungs that this study can tell of."""
    by_method = runs_by_method((run for result in results.values() for run in result["runs"]), METHODS)
    rows = [method_row(method, by_method, CONTROLS) for method in by_method]
    if FBQL in by_method and RETUNED in by_method:
        rows += tree_rows(by_method[FBQL], by_method[RETUNED], results)
        rows += rung_rows(by_method[FBQL], by_method[RETUNED], by_method[LAW])
    return rows


def figures(results: Mapping[str, Result], directory: Path) -> list[Path]:
    """None yet."""
    return []
