"""The paper's drawback: there are as many joint states as the product of the leaf counts. fbql with 3, 4, 6 and 8 behaviors.

The fourth behavior is the example's (examples/shooting). Further ones are trees of the same behaviors from other
demonstrations, under their own names: they add no new skill to the team, which is the hard case.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path
from time import perf_counter

from fbql.demonstrations.make_tree import make_tree
from fbql.statistics.runs import ratio, runs_by_method
from fbql.statistics.tables import Row, Table, finite, number, tabulate
from fbql_behaviors.core.behavior import Behavior
from fbql_behaviors.observation_loading import load_observation
from fbql_behaviors.storage import load_tree
from fbql_common.checkout import source_tree
from fbql_common.core.errors import BadInput
from fbql_sim.core.parameters import SimulationParameters
from fbql_sim.core.world_loop import WorldLoop

from fbql_studies.common.fusion_tables import METHOD_COLUMNS, SIZE_COLUMNS, byte_text, cost, share
from fbql_studies.common.learning_curves import Trainings, growth, learning, mean_sizes, trainings_by
from fbql_studies.common.methods import BEHAVIORS
from fbql_studies.common.play import frozen
from fbql_studies.common.training import Seeds, add_training_options, check_training_options, train, training_of
from fbql_studies.runner.study import MEASURED, Parameters, Result, StudyTask

DESCRIPTION = "fbql with 3, 4, 6 and 8 behaviors: learning curves and memory against the product of the leaves"
CAPTIONS = {
    "fusion_scaling": "Memory and learning with 3, 4, 6 and 8 behaviors",
}
COLUMNS = {
    **METHOD_COLUMNS,
    **SIZE_COLUMNS,
    "behaviors": "number of behaviors that are fused",
    "table_bytes": "bytes that a table of Q and w over leaf_product would take",
}
SEEDS = Seeds(1201, 5000)
COUNTS = (3, 4, 6, 8)
SHOOTING = "shooting"
OTHER_DEMONSTRATIONS = 1000
"""Each further tree of a behavior is made with a demonstration seed that is higher by this."""
TABLE_VALUES = 2
"""Values that the paper's table holds for each behavior in each joint state: Q and w."""
FLOAT_BYTES = 8


def names_of(n: int) -> tuple[str, ...]:
    """The names of n behaviors."""
    return (*BEHAVIORS, SHOOTING, *(f"{BEHAVIORS[k % 3]}_{k // 3 + 2}" for k in range(max(COUNTS) - 4)))[:n]


def behaviors_of(n: int, tree_set: int) -> list[Behavior]:
    """n behaviors of a tree set."""
    found = SEEDS.behaviors(tree_set)
    if n > len(found):
        tree = source_tree()
        if tree is None:
            raise BadInput("more than 3 behaviors need examples/shooting, which only a clone has: run this study there")
        example = tree / "examples" / SHOOTING
        source = load_observation(f"{example / 'shooting.py'}:{SHOOTING}")
        found.append(Behavior(SHOOTING, load_tree(example / "shooting.json"), source.observation))
    for k, name in enumerate(names_of(n)[len(found) :]):
        seed = SEEDS.tree(tree_set) + OTHER_DEMONSTRATIONS * (k // 3 + 1)
        found.append(Behavior(name, make_tree(BEHAVIORS[k % 3], seed).tree))
    return found


def add_options(parser: argparse.ArgumentParser) -> None:
    """Adds the study's own options."""
    add_training_options(parser, trees=2, seeds=2, episodes=1500, evaluate=100)


def tasks(options: argparse.Namespace) -> list[StudyTask]:
    """A training for each number of behaviors, tree set and seed."""
    check_training_options(options)
    return [
        StudyTask(
            f"behaviors{n}-trees{SEEDS.tree(k)}-seed{seed}",
            {
                "behaviors": n,
                "set": k,
                "seed": seed,
                "episodes": options.episodes,
                "evaluate": options.evaluate,
                "max_steps": options.max_steps,
            },
        )
        for seed in range(options.seeds)
        for k in range(options.trees)
        for n in COUNTS
    ]


def run(parameters: Parameters) -> Result:
    """Trains n behaviors and plays them frozen."""
    n, tree_set, seed = parameters["behaviors"], parameters["set"], parameters["seed"]
    behaviors = behaviors_of(n, tree_set)
    loop = WorldLoop(SimulationParameters(max_steps=parameters["max_steps"]))
    fusion = training_of(SEEDS.training(seed), parameters["episodes"], behaviors=list(names_of(n)))
    begun_s = perf_counter()
    trained = train(fusion, behaviors, loop)
    training_s = perf_counter() - begun_s
    judge = SEEDS.judging(tree_set, seed)
    reached = frozen(fusion, behaviors, loop, judge, parameters["evaluate"], trained.policy)
    row = SEEDS.row(method_of(n), tree_set, seed, reached)
    return {"runs": [row], "curve": trained.curve, "size": trained.size, MEASURED: {"training_s": training_s}}


def method_of(n: int) -> str:
    """The name of n behaviors in tables."""
    return f"{n} behaviors"


def table(results: Mapping[str, Result]) -> list[Row]:
    """Memory and performance for each number of behaviors; memory is the mean over trainings."""
    by_method = runs_by_method((run for result in results.values() for run in result["runs"]), _methods())
    trainings = _trainings(results)
    rows: list[Row] = []
    for n in COUNTS:
        runs = by_method.get(method_of(n))
        if not runs:
            continue
        trained = list(trainings[method_of(n)].values())
        mean = mean_sizes(trained)
        per_goal = ratio(runs, "steps", "goals")
        row: Row = {
            "behaviors": n,
            "runs": len(runs),
            **{name: mean[name] for name in ("leaf_product", "joint_states", "features", "bytes")},
            "table_bytes": mean["leaf_product"] * n * TABLE_VALUES * FLOAT_BYTES,
            "success_rate": ratio(runs, "goals", "episodes").estimate,
            "cost_per_goal": per_goal.estimate,
            "cost_low": per_goal.low,
            "cost_high": per_goal.high,
            "own_goals": sum(run["own_goals"] for run in runs.values()),
            "timeouts": sum(run["timeouts"] for run in runs.values()),
            "training_s": mean["training_s"],
        }
        rows.append(finite(row))
    return rows


def _methods() -> tuple[str, ...]:
    return tuple(map(method_of, COUNTS))


def _trainings(results: Mapping[str, Result]) -> dict[str, Trainings]:
    return trainings_by(results, lambda result: result["runs"][0]["method"], _methods())


def words(rows: Sequence[Row]) -> dict[str, Table]:
    """Title -> table."""
    return {
        "behaviors": tabulate(
            rows,
            {
                "behaviors": lambda row: str(row["behaviors"]),
                "runs": lambda row: str(row["runs"]),
                "product of leaves": lambda row: f"{row['leaf_product']:.3g}",
                "its table": lambda row: byte_text(row["table_bytes"]),
                "joint states met": lambda row: f"{row['joint_states']:.0f}",
                "features": lambda row: f"{row['features']:.0f}",
                "policy": lambda row: byte_text(row["bytes"]),
                "success rate": lambda row: share(row["success_rate"]),
                "cost/goal (95 %)": cost,
                "training [s]": lambda row: number(row["training_s"], ".0f"),
            },
        )
    }


def figures(results: Mapping[str, Result], directory: Path) -> list[Path]:
    """Memory against the product, and learning curves; and the numbers they are drawn from (curves.json)."""
    by_name = _trainings(results)
    if not by_name:
        return []
    from fbql_studies.common.drawing import keep_and_draw
    from fbql_studies.scaling.figures import FIGURES

    memory = ("behaviors", "leaf_product", "joint_states", "features", "bytes", "table_bytes")
    curves = {
        "scaling": {
            "memory": [{name: row[name] for name in memory} for row in table(results)],
            "learning": learning(by_name, {}),
            "growth": growth(by_name),
        }
    }
    return keep_and_draw(FIGURES, curves, directory)
