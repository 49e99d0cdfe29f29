"""The controls of the studies of fusion on the episodes that evaluate the learners: one task per tree set."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from fbql.statistics.tables import Row
from fbql_behaviors.core.behavior import Behavior
from fbql_fusion.core.parameters import FusionParameters
from fbql_sim.core.world_loop import WorldLoop

from fbql_studies.common.methods import CONSTANT, PAPER, RETUNED, TUNED, UNIFORM
from fbql_studies.common.play import bound_steps, frozen, laws_played
from fbql_studies.common.training import Seeds
from fbql_studies.common.tuning import best_blend, blend_played, retuned, subsumption
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


def bounds_of(seeds: Seeds, tree_set: int, seed: int, episodes: int) -> list[Row]:
    """The kinematic bounds, as they are stored, of the episodes that evaluate a training."""
    return [
        seeds.row(ball, tree_set, seed, {"steps": steps, "episodes": episodes})
        for ball, steps in bound_steps(seeds.judging(tree_set, seed), episodes).items()
    ]


def least_steps_by_ball(results: Mapping[str, Result]) -> dict[str, float]:
    """What a kinematic bound assumes of the ball -> the least steps per episode, from the bounds that the tasks stored."""
    bounds = [each for result in results.values() for each in result.get("bounds", [])]
    found: dict[str, float] = {}
    for ball in dict.fromkeys(each["method"] for each in bounds):
        own = [each for each in bounds if each["method"] == ball]
        steps, episodes = (sum(each[name] for each in own) for name in ("steps", "episodes"))
        found[ball] = steps / episodes
    return found


def controls_played(seeds: Seeds, parameters: Parameters, behaviors: Sequence[Behavior], loop: WorldLoop) -> Result:
    """Every control of a tree set on the episodes of each of its trainings, and the kinematic bounds of these episodes."""
    tree_set, episodes = parameters["set"], parameters["evaluate"]
    thresholds = retuned(behaviors, loop)
    weights = best_blend(behaviors, loop)
    fixed = {
        PAPER: FusionParameters(controller="subsumption", preset="paper"),
        TUNED: FusionParameters(controller="subsumption", preset="tuned"),
        RETUNED: subsumption(thresholds, 0, episodes),
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
        bounds += bounds_of(seeds, tree_set, seed, episodes)
    leaves = [behavior.tree.leaf_count for behavior in behaviors]
    return {
        "runs": runs, "bounds": bounds, "thresholds": [*thresholds], "weights": list(weights), "leaves": leaves
    }  # fmt: skip
