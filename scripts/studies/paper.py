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
from fbql_fusion.core.controllers import FbqlLiteral
from fbql_fusion.core.equations import tied
from fbql_fusion.core.metrics import OUTCOMES, EpisodeRecord
from fbql_fusion.core.parameters import GUIDED_EPISODES, FusionParameters
from fbql_fusion.core.policy import Policy
from fbql_fusion.core.session import Session
from fbql_sim.core.parameters import SimulationParameters
from fbql_sim.core.world_loop import WorldLoop
from launcher.in_process import play
from launcher.make_trees import make_tree

from studies.comparison import Runs, method_row, runs_by_method
from studies.courses import courses
from studies.ladder_rungs import early_rung_rows
from studies.study import Parameters, Result, Row, Task

DESCRIPTION = "the paper's protocol: 20 guided episodes, then until 50 goals, all methods on the same starts"
FIRST_TREE_SEED = 1001
"""Demonstration seed of the first tree set: no tuning saw it or those after it."""
FIRST_RUN_SEED = 1000
"""Run seeds below it are for tuning."""
TUNING_SEED = 11
TUNING_ROUNDS = ((30, 12), (150, 4), (500, 1))
"""Training episodes that each pair of thresholds plays, and how many pairs are left after it."""
WALL_M = (0.0, 0.06, 0.07, 0.08, 0.10, 0.12)
APPROACH_RAD = (0.0, 0.05, 0.1, 0.15, 0.3, 1.0)
RUNS_PER_TASK = 4
MOST_EPISODES = 400
"""A method that does not score 50 goals in so many episodes ends there."""
BEHAVIORS = ("ball_seeking", "wall_avoiding", "approaching")
_DRAWN = {"controller": "fbql", "fbql_play": "drawn"}
"""As fbql plays while it learns."""
METHODS: dict[str, FusionParameters] = {
    "subsumption, paper": FusionParameters(controller="subsumption", preset="paper"),
    "subsumption, tuned": FusionParameters(controller="subsumption", preset="tuned"),
    "subsumption, re-tuned": FusionParameters(controller="subsumption"),
    "uniform weights": FusionParameters(controller="uniform"),
    "fbql literal, ties: none": FusionParameters(controller="fbql_literal", tie_rule="none"),
    "fbql literal, ties: first": FusionParameters(controller="fbql_literal", tie_rule="first"),
    "fbql literal, frozen twin": FusionParameters(controller="fbql_literal", learn=False),
    "fbql": FusionParameters(**_DRAWN),
    "fbql, only guided": FusionParameters(**_DRAWN, learn=False),
    "fbql, paper's guide": FusionParameters(**_DRAWN, preset="paper"),
    "fbql, paper's guide, only guided": FusionParameters(**_DRAWN, preset="paper", learn=False),
    "fbql, never learned": FusionParameters(**_DRAWN, learn=False),
}
"""The guide of a learner is Subsumption with the tuned preset, but where the method says otherwise."""
PAPER, RETUNED = "subsumption, paper", "subsumption, re-tuned"
LITERAL_TWIN, UNTRAINED = "fbql literal, frozen twin", "fbql, never learned"
TWINS = {"fbql": "fbql, only guided", "fbql, paper's guide": "fbql, paper's guide, only guided"}
"""Learner -> the same, frozen when the guided episodes were over."""
CONTROLS = {"paper": PAPER, "retuned": RETUNED, "frozen": LITERAL_TWIN, "untrained": UNTRAINED}


def add_options(parser: argparse.ArgumentParser) -> None:
    """Adds the study's own options."""
    parser.add_argument("--seeds", type=int, default=20, metavar="N", help="run seeds of each tree set (20)")
    parser.add_argument("--trees", type=int, default=5, metavar="N", help="tree sets, each of other demonstrations (5)")
    parser.add_argument("--goals", type=int, default=50, metavar="N", help="goals after the guided episodes (50)")
    add_max_steps(parser)


def add_max_steps(parser: argparse.ArgumentParser) -> None:
    """Adds the option of the simulator."""
    most = SimulationParameters().max_steps
    parser.add_argument(
        "--max-steps", type=int, default=most, metavar="N", help=f"steps after which an episode is truncated ({most})"
    )


DRAWN = (PAPER, RETUNED, "fbql literal, ties: none", "fbql")
"""The methods of the figures."""


def tasks(options: argparse.Namespace) -> list[Task]:
    """A task for each tree set and every RUNS_PER_TASK run seeds."""
    return [
        Task(
            f"trees{tree}-seeds{block[0]}",
            {"tree_seed": tree, "run_seeds": list(block), "goals": options.goals, "max_steps": options.max_steps},
        )
        for tree in range(FIRST_TREE_SEED, FIRST_TREE_SEED + options.trees)
        for block in batched(range(FIRST_RUN_SEED, FIRST_RUN_SEED + options.seeds), RUNS_PER_TASK)
    ]


def run(parameters: Parameters) -> Result:
    """Plays every method for every run seed; gives its figures and its episodes."""
    behaviors = [Behavior(name, make_tree(name, parameters["tree_seed"]).tree) for name in BEHAVIORS]
    loop = WorldLoop(SimulationParameters(max_steps=parameters["max_steps"]))
    thresholds = retuned(behaviors, loop)
    runs: list[dict[str, object]] = []
    for seed in parameters["run_seeds"]:
        for method, fusion in METHODS.items():
            fusion = replace(
                fusion, seed=seed, guided=GUIDED_EPISODES, goals=parameters["goals"], episodes=MOST_EPISODES
            )
            if method == RETUNED:
                fusion = replace(fusion, wall_threshold_m=thresholds[0], approach_threshold_rad=thresholds[1])
            policy = None
            if method in TWINS.values():
                policy = after_guidance(replace(fusion, learn=True), behaviors, loop)
            runs.append({"method": method, "seed": seed, **play_run(fusion, behaviors, loop, policy)})
    return {"tree_seed": parameters["tree_seed"], "retuned": list(thresholds), "runs": runs}


def play_run(
    fusion: FusionParameters, behaviors: Sequence[Behavior], loop: WorldLoop, policy: Policy | None = None
) -> dict[str, object]:
    """One run of one method: what is counted, and [outcome, steps, begun, contact] of each episode."""
    session = Session(fusion, policy)
    play(session, loop, behaviors, lambda: True)
    counted = [record for record in session.records if record.phase is not Phase.GUIDED]
    result: dict[str, object] = {
        **figures_of(counted),
        "course": [
            [OUTCOMES.index(record.outcome), record.steps, record.collisions_begun, record.collision_steps]
            for record in counted
        ],
        "digest": session.digest,
    }
    learned = session.policy()
    if learned is not None and learned.kind == FbqlLiteral.kind and fusion.learn:
        q = learned.arrays["q"]
        result |= {"joint_states": len(q), "tied": tied(q)}
    return result


def after_guidance(fusion: FusionParameters, behaviors: Sequence[Behavior], loop: WorldLoop) -> Policy:
    """What is known when the guided episodes are over and nothing more was learned."""
    session = Session(fusion)
    play(session, loop, behaviors, lambda: len(session.records) < session.guided)
    session.next_episode()  # only now the guided episodes are learned from
    policy = session.policy()
    assert policy is not None
    return policy


def figures_of(records: Sequence[EpisodeRecord]) -> dict[str, int]:
    """What is counted over episodes."""
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


def retuned(behaviors: Sequence[Behavior], loop: WorldLoop) -> tuple[float, float]:
    """Subsumption's thresholds (wall [m], psi [rad]) with the least cost/goal for a tree set, on training episodes.

    All pairs play a few episodes, the best of them many: a deadlock that comes once in fifty episodes decides what a pair
    is worth, and few episodes don't show it: chosen on 30 alone, a pair had 6 timeouts in 100 fresh episodes.
    """
    pairs = [(wall_m, approach_rad) for wall_m in WALL_M for approach_rad in APPROACH_RAD]
    for episodes, left in TUNING_ROUNDS:
        if len(pairs) > left:
            costs = {pair: _cost_with(pair, behaviors, loop, episodes) for pair in pairs}
            pairs = sorted(pairs, key=lambda pair: costs[pair])[:left]
    return pairs[0]


def _cost_with(thresholds: tuple[float, float], behaviors: Sequence[Behavior], loop: WorldLoop, episodes: int) -> float:
    """cost/goal on so many training episodes; infinite without a goal."""
    wall_m, approach_rad = thresholds
    fusion = FusionParameters(
        controller="subsumption",
        seed=TUNING_SEED,
        episodes=episodes,
        wall_threshold_m=wall_m,
        approach_threshold_rad=approach_rad,
    )
    session = Session(fusion)
    play(session, loop, behaviors, lambda: True)
    cost = session.summary().cost_per_goal
    return float("inf") if cost is None else cost


def table(results: Mapping[str, Result]) -> list[Row]:
    """Methods, with intervals over tree sets and runs and paired with the controls; then the rungs of 50 goals."""
    by_method = runs_of(results)
    rows = [
        {
            **method_row(method, by_method, CONTROLS | ({"guided": TWINS[method]} if method in TWINS else {})),
            **_tied(runs),
        }
        for method, runs in by_method.items()
    ]
    columns = {name: None for row in rows for name in row}
    rows = [{**columns, **row} for row in rows]
    if PAPER in by_method:
        for method in TWINS:
            if method in by_method:
                rows += early_rung_rows(method, by_method, PAPER, UNTRAINED, TWINS[method])
    return rows


def runs_of(results: Mapping[str, Result]) -> dict[str, Runs]:
    """Method -> (tree seed, run seed) -> run."""
    found = ({**each, "tree_seed": result["tree_seed"]} for result in results.values() for each in result["runs"])
    return runs_by_method(found, tuple(METHODS))


def _tied(runs: Runs) -> Row:
    """How many joint states the literal learner met on average, and in what share of them all Q are equal in the end."""
    met = [run for run in runs.values() if "tied" in run]
    joint_states = sum(run["joint_states"] for run in met)
    if not joint_states:
        return {"joint_states": None, "tied_share": None}
    return {
        "joint_states": joint_states / len(met),
        "tied_share": sum(run["tied"] for run in met) / joint_states,
    }


def figures(results: Mapping[str, Result], directory: Path) -> list[Path]:
    """The analogues of the paper's Figs. 10 to 14, and the numbers they are drawn from (curves.json)."""
    by_method = runs_of(results)
    if not by_method:
        return []
    from studies.fusion_figures import draw, write_curves

    curves = {"paper": courses({method: by_method[method] for method in DRAWN if method in by_method})}
    return [write_curves(curves, directory), *draw(curves, directory)]
