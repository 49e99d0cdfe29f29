"""The paper's protocol: 20 guided episodes, then until 50 goals, for every method on the same trees and the same starts.

A task is a tree set and some run seeds. Every method meets the same episodes: guided ones are played by all, also by those
that learn nothing, so that episode k of a run has the same start for each.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import batched
from pathlib import Path

from fbql_behaviors.core.behavior import Behavior
from fbql_common.core.types import Phase
from fbql_fusion.core.metrics import EpisodeRecord
from fbql_fusion.core.parameters import GUIDED_EPISODES, FusionParameters
from fbql_fusion.core.session import Session
from fbql_sim.core.world_loop import WorldLoop
from launcher.in_process import play
from launcher.make_trees import make_tree

from studies.inference import paired_p_value, ratio_of_sums
from studies.study import Parameters, Result, Row, Task

DESCRIPTION = "the paper's protocol: 20 guided episodes, then until 50 goals, all methods on the same starts"
FIRST_TREE_SEED = 1001
"""Demonstration seed of the first tree set: no tuning saw it or those after it."""
FIRST_RUN_SEED = 1000
"""Run seeds below it are for tuning."""
TUNING_SEED = 11
TUNING_EPISODES = 30
WALL_M = (0.0, 0.06, 0.07, 0.08, 0.10, 0.12)
APPROACH_RAD = (0.0, 0.05, 0.1, 0.15, 0.3, 1.0)
RUNS_PER_TASK = 4
MOST_EPISODES = 400
"""A method that does not score 50 goals in so many episodes ends there."""
BEHAVIORS = ("ball_seeking", "wall_avoiding", "approaching")
FIGURES = (
    "goals",
    "own_goals",
    "timeouts",
    "episodes",
    "steps",
    "collisions_begun",
    "collision_steps",
    "steps_to_goals",
)

METHODS: dict[str, FusionParameters] = {
    "subsumption, paper": FusionParameters(controller="subsumption", preset="paper"),
    "subsumption, tuned": FusionParameters(controller="subsumption", preset="tuned"),
    "subsumption, re-tuned": FusionParameters(controller="subsumption"),
    "uniform weights": FusionParameters(controller="uniform"),
    "fbql literal, ties: none": FusionParameters(controller="fbql_literal", tie_rule="none"),
    "fbql literal, ties: first": FusionParameters(controller="fbql_literal", tie_rule="first"),
    "fbql literal, frozen twin": FusionParameters(controller="fbql_literal", learn=False),
}
RETUNED = "subsumption, re-tuned"


def add_options(parser: argparse.ArgumentParser) -> None:
    """Adds the study's own options."""
    parser.add_argument("--seeds", type=int, default=20, metavar="N", help="run seeds of each tree set (20)")
    parser.add_argument("--trees", type=int, default=5, metavar="N", help="tree sets, each of other demonstrations (5)")
    parser.add_argument("--goals", type=int, default=50, metavar="N", help="goals after the guided episodes (50)")


def tasks(options: argparse.Namespace) -> list[Task]:
    """A task for each tree set and every RUNS_PER_TASK run seeds."""
    return [
        Task(f"trees{tree}-seeds{block[0]}", {"tree_seed": tree, "run_seeds": list(block), "goals": options.goals})
        for tree in range(FIRST_TREE_SEED, FIRST_TREE_SEED + options.trees)
        for block in batched(range(FIRST_RUN_SEED, FIRST_RUN_SEED + options.seeds), RUNS_PER_TASK)
    ]


def run(parameters: Parameters) -> Result:
    """Plays every method for every run seed; gives its figures, and the steps and collisions of its successes."""
    behaviors = [Behavior(name, make_tree(name, parameters["tree_seed"]).tree) for name in BEHAVIORS]
    loop = WorldLoop()
    thresholds = retuned(behaviors, loop)
    runs: list[dict[str, object]] = []
    for seed in parameters["run_seeds"]:
        for method, fusion in METHODS.items():
            fusion = replace(
                fusion, seed=seed, guided=GUIDED_EPISODES, goals=parameters["goals"], episodes=MOST_EPISODES
            )
            if method == RETUNED:
                fusion = replace(fusion, wall_threshold_m=thresholds[0], approach_threshold_rad=thresholds[1])
            runs.append({"method": method, "seed": seed, **play_run(fusion, behaviors, loop)})
    return {"tree_seed": parameters["tree_seed"], "retuned": list(thresholds), "runs": runs}


def play_run(fusion: FusionParameters, behaviors: list[Behavior], loop: WorldLoop) -> dict[str, object]:
    """One run of one method: FIGURES over the episodes that count, and a row [steps, begun, contact] for each goal."""
    session = Session(fusion)
    play(session, loop, behaviors, lambda: True)
    counted = [record for record in session.records if record.phase is not Phase.GUIDED]
    successes = [record for record in counted if record.outcome == "goal"]
    return {
        **figures_of(counted),
        "successes": [[record.steps, record.collisions_begun, record.collision_steps] for record in successes],
        "digest": session.digest,
    }


def figures_of(records: Sequence[EpisodeRecord]) -> dict[str, int]:
    """FIGURES over episodes."""
    successes = [record for record in records if record.outcome == "goal"]
    return {
        "goals": len(successes),
        "own_goals": sum(record.outcome == "own_goal" for record in records),
        "timeouts": sum(record.outcome == "timeout" for record in records),
        "episodes": len(records),
        "steps": sum(record.steps for record in records),
        "collisions_begun": sum(record.collisions_begun for record in records),
        "collision_steps": sum(record.collision_steps for record in records),
        "steps_to_goals": sum(record.steps for record in successes),
    }


def retuned(behaviors: list[Behavior], loop: WorldLoop) -> tuple[float, float]:
    """Subsumption's thresholds (wall [m], psi [rad]) with the least cost/goal for a tree set, on training episodes."""
    costs: dict[tuple[float, float], float] = {}
    for wall_m in WALL_M:
        for approach_rad in APPROACH_RAD:
            fusion = FusionParameters(
                seed=TUNING_SEED,
                episodes=TUNING_EPISODES,
                wall_threshold_m=wall_m,
                approach_threshold_rad=approach_rad,
            )
            session = Session(fusion)
            play(session, loop, behaviors, lambda: True)
            cost = session.summary().cost_per_goal
            costs[wall_m, approach_rad] = float("inf") if cost is None else cost
    return min(costs, key=lambda pair: costs[pair])


def table(results: Mapping[str, Result]) -> list[Row]:
    """Method x what it reached, with intervals over runs and paired tests against the controls."""
    runs: dict[str, list[dict[str, float]]] = {method: [] for method in METHODS}
    for result in results.values():
        for each in result["runs"]:
            runs[each["method"]].append(each)
    if not results:
        return []
    return [_row(method, runs) for method in METHODS]


def _row(method: str, runs: Mapping[str, list[dict[str, float]]]) -> Row:
    own = runs[method]
    sums = {name: sum(each[name] for each in own) for name in FIGURES}
    cost = ratio_of_sums([each["steps"] for each in own], [each["goals"] for each in own])
    success = ratio_of_sums([each["goals"] for each in own], [each["episodes"] for each in own])
    row: Row = {
        "method": method,
        "runs": len(own),
        "goals": sums["goals"],
        "own_goals": sums["own_goals"],
        "timeouts": sums["timeouts"],
        "success_rate": success.estimate,
        "cost_per_goal": cost.estimate,
        "cost_low": cost.low,
        "cost_high": cost.high,
        "steps_per_success": sums["steps_to_goals"] / sums["goals"] if sums["goals"] else None,
        "collisions_begun_per_goal": sums["collisions_begun"] / sums["goals"] if sums["goals"] else None,
        "collision_steps_per_goal": sums["collision_steps"] / sums["goals"] if sums["goals"] else None,
    }
    for name, control in (
        ("paper", "subsumption, paper"),
        ("retuned", RETUNED),
        ("frozen", "fbql literal, frozen twin"),
    ):
        other = runs[control]
        ratio = cost.estimate / ratio_of_sums([x["steps"] for x in other], [x["goals"] for x in other]).estimate
        row[f"ratio_{name}"] = ratio
        row[f"p_{name}"] = None if method == control else paired_p_value(_costs(own), _costs(other))
    return row


def _costs(runs: list[dict[str, float]]) -> list[float]:
    """cost/goal of each run; one without a goal costs what it took."""
    return [each["steps"] / max(each["goals"], 1) for each in runs]


def figures(results: Mapping[str, Result], directory: Path) -> list[Path]:
    """None yet: the analogues of Figs. 10 to 14 come with the fusion study."""
    return []
