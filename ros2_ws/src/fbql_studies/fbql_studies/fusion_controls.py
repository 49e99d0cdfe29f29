"""What fusion that learns is held against: Subsumption, constant weights and the scripted law, on the same episodes."""

from __future__ import annotations

from collections.abc import Sequence

from fbql.statistics.tables import Row
from fbql_behaviors.core.behavior import Behavior
from fbql_fusion.core.parameters import FusionParameters
from fbql_sim.core.world_loop import WorldLoop

from fbql_studies.constant_blend import CONSTANT, best_blend, blend_played
from fbql_studies.runner.study import Parameters, Result, Task
from fbql_studies.training import Seeds, frozen, law_played
from fbql_studies.tuning import retuned

LAW, UNIFORM = "scripted law, sees all", "uniform weights"
PAPER, TUNED, RETUNED = "subsumption, paper", "subsumption, tuned", "subsumption, re-tuned"
METHODS = (LAW, PAPER, TUNED, RETUNED, UNIFORM, CONSTANT)


def control_tasks(seeds: Seeds, tree_sets: int, count: int, given: Parameters) -> list[Task]:
    """A task for each tree set: what is tuned for it is tuned once and judged on the episodes of every training.

    With more trainings it is another task.
    """
    return [
        Task(f"controls-trees{seeds.tree(k)}-seeds{count}", {"part": "controls", "set": k, "seeds": count, **given})
        for k in range(tree_sets)
    ]


def controls_played(seeds: Seeds, parameters: Parameters, behaviors: Sequence[Behavior], loop: WorldLoop) -> Result:
    """Every control of a tree set on the episodes of each of its trainings."""
    tree_set, episodes = parameters["set"], parameters["evaluate"]
    wall_m, approach_rad = retuned(behaviors, loop)
    weights = best_blend(behaviors, loop)
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
        judge = seeds.judging(tree_set, seed)
        runs.append(seeds.row(LAW, tree_set, seed, law_played(loop, judge, episodes)))
        for method, fusion in controls.items():
            runs.append(seeds.row(method, tree_set, seed, frozen(fusion, behaviors, loop, judge, episodes)))
        blended = blend_played(weights, behaviors, loop, judge, episodes)
        runs.append(seeds.row(CONSTANT, tree_set, seed, blended))
    leaves = [behavior.tree.leaf_count for behavior in behaviors]
    return {"runs": runs, "thresholds": [wall_m, approach_rad], "weights": list(weights), "leaves": leaves}
