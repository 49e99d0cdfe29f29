"""The controls of the studies of fusion on the episodes that evaluate the learners: one task per tree set."""

from __future__ import annotations

from collections.abc import Sequence

from fbql.statistics.tables import Row
from fbql_behaviors.core.behavior import Behavior
from fbql_fusion.core.parameters import FusionParameters
from fbql_sim.core.world_loop import WorldLoop

from fbql_studies.common.methods import CONSTANT, PAPER, RETUNED, TUNED, UNIFORM
from fbql_studies.common.play import bound_steps, frozen, laws_played
from fbql_studies.common.training import Seeds
from fbql_studies.common.tuning import best_blend, blend_played, retuned
from fbql_studies.runner.study import Parameters, Result, StudyTask


def control_tasks(seeds: Seeds, tree_sets: int, count: int, given: Parameters) -> list[StudyTask]:
    """A task for each tree set: the controls are tuned once and evaluated on the episodes of every training.

    The number of trainings is a part of the key, because the task plays the episodes of all of them.
    """
    return [
        StudyTask(
            f"controls-trees{seeds.tree(k)}-seeds{count}", {"part": "controls", "set": k, "seeds": count, **given}
        )
        for k in range(tree_sets)
    ]


def controls_played(seeds: Seeds, parameters: Parameters, behaviors: Sequence[Behavior], loop: WorldLoop) -> Result:
    """Every control of a tree set on the episodes of each of its trainings, and the kinematic bounds of these episodes."""
    tree_set, episodes = parameters["set"], parameters["evaluate"]
    wall_m, approach_rad = retuned(behaviors, loop)
    weights = best_blend(behaviors, loop)
    fixed = {
        PAPER: FusionParameters(controller="subsumption", preset="paper"),
        TUNED: FusionParameters(controller="subsumption", preset="tuned"),
        RETUNED: FusionParameters(
            controller="subsumption", wall_threshold_m=wall_m, approach_threshold_rad=approach_rad
        ),
        UNIFORM: FusionParameters(controller="uniform"),
    }
    runs: list[Row] = []
    bounds: list[Row] = []
    for seed in range(parameters["seeds"]):
        judge = seeds.judging(tree_set, seed)
        counts = {
            **laws_played(loop, judge, episodes),
            **{method: frozen(fusion, behaviors, loop, judge, episodes) for method, fusion in fixed.items()},
            CONSTANT: blend_played(weights, behaviors, loop, judge, episodes),
        }
        runs += [seeds.row(method, tree_set, seed, each) for method, each in counts.items()]
        for ball, steps in bound_steps(judge, episodes).items():
            bounds.append(seeds.row(ball, tree_set, seed, {"steps": steps, "episodes": episodes}))
    leaves = [behavior.tree.leaf_count for behavior in behaviors]
    return {
        "runs": runs, "bounds": bounds, "thresholds": [wall_m, approach_rad], "weights": list(weights), "leaves": leaves
    }  # fmt: skip
