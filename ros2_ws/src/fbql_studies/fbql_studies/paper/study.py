"""The paper's protocol: 20 guided episodes, then until 50 goals, for every method on the same trees and the same starts.

A task is a tree set and some run seeds; the Subsumption that is tuned for a tree set has its own task, so that it is
tuned only once. Every method meets the same episodes: methods that learn nothing play the guided ones as well, so that
episode k of a run has the same start for each.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import batched
from pathlib import Path

from fbql.match.in_process import play
from fbql.match.trees import playing_trees
from fbql.statistics.courses import courses
from fbql.statistics.runs import Runs, method_row, runs_by_method
from fbql.statistics.tables import Row, with_all_columns
from fbql_behaviors.core.behavior import Behavior
from fbql_common.core.types import Phase
from fbql_fusion.core.controllers.parameters import GUIDED_EPISODES
from fbql_fusion.core.learners.literal.equations import count_ties
from fbql_fusion.core.learners.literal.learner import FbqlLiteral
from fbql_fusion.core.parameters import FusionParameters
from fbql_fusion.core.policy import Policy
from fbql_fusion.core.soccer_session import SoccerSession
from fbql_recording.core.metrics import OUTCOMES
from fbql_sim.core.parameters import SimulationParameters
from fbql_sim.core.world_loop import WorldLoop

from fbql_studies.common.methods import (
    FBQL,
    LEARNERS,
    LITERAL_TWIN,
    PAPER,
    RETUNED,
    TIES_FIRST,
    TIES_NONE,
    TUNED,
    UNIFORM,
    guided,
    papers_guide,
    untrained,
)
from fbql_studies.common.play import counts_of
from fbql_studies.common.training import (
    FIRST_RUN_SEED,
    FIRST_TREE_SEED,
    add_max_steps,
    after_guidance,
    as_it_learns,
    behaviors_of,
)
from fbql_studies.common.tuning import retuned
from fbql_studies.paper import tables
from fbql_studies.runner.study import (
    MOST_PLAYED,
    MOST_SEEDS,
    Parameters,
    Result,
    StudyTask,
    add_count,
    check_counts,
)

DESCRIPTION = "the paper's protocol: 20 guided episodes, then until 50 goals, all methods on the same starts"
CAPTIONS = {
    "fusion_paper": "The analogues of the paper's Figs. 10 to 14, as moving averages over 5 successes with 95 % intervals over tree sets and runs",
}
COLUMNS, words = tables.COLUMNS, tables.words
MOST_TREE_SETS = 100
"""The tree sets of other studies come after these."""
RUNS_PER_TASK = 4
MOST_EPISODES = 400
"""A run ends after this many episodes, regardless of its goals."""


def _methods_of(learner: str) -> dict[str, FusionParameters]:
    """A learner and its frozen twins, with either guide. All play as the learner does while it learns."""
    drawn = {"controller": learner, **as_it_learns(learner)}
    papers = papers_guide(learner)
    return {
        learner: FusionParameters(**drawn),
        guided(learner): FusionParameters(**drawn, learn=False),
        papers: FusionParameters(**drawn, preset="paper"),
        guided(papers): FusionParameters(**drawn, preset="paper", learn=False),
        untrained(learner): FusionParameters(**drawn, learn=False),
    }


METHODS: dict[str, FusionParameters] = {
    PAPER: FusionParameters(controller="subsumption", preset="paper"),
    TUNED: FusionParameters(controller="subsumption", preset="tuned"),
    RETUNED: FusionParameters(controller="subsumption"),
    UNIFORM: FusionParameters(controller="uniform"),
    TIES_NONE: FusionParameters(controller="fbql_literal", tie_rule="none"),
    TIES_FIRST: FusionParameters(controller="fbql_literal", tie_rule="first"),
    LITERAL_TWIN: FusionParameters(controller="fbql_literal", learn=False),
    **{method: fusion for learner in LEARNERS for method, fusion in _methods_of(learner).items()},
}
"""The guide of a learner is Subsumption with the tuned preset unless the method's name names another."""
TWINS: dict[str, dict[str, str]] = {
    method: {"untrained": untrained(learner), "guided": guided(method)}
    for learner in LEARNERS
    for method in (learner, papers_guide(learner))
}
"""Method that learns -> its frozen twins: the same play without learning at all, or with learning stopped after the
guided episodes."""
CONTROLS = {"paper": PAPER, "retuned": RETUNED, "frozen": LITERAL_TWIN}


def add_options(parser: argparse.ArgumentParser) -> None:
    """Adds the study's own options."""
    add_count(parser, "--seeds", 20, "run seeds of each tree set")
    add_count(parser, "--trees", 5, "tree sets, each from other demonstrations")
    most = f"a run that takes more than {MOST_EPISODES} episodes ends there"
    add_count(parser, "--goals", 50, f"goals after the guided episodes; {most}")
    add_max_steps(parser)


DRAWN = (
    PAPER, RETUNED, TIES_NONE, *LEARNERS, papers_guide(FBQL), guided(papers_guide(FBQL)),
)  # fmt: skip
"""The methods of the figures."""


def tasks(options: argparse.Namespace) -> list[StudyTask]:
    """For each tree set a task for the Subsumption tuned for it, and one for all other methods per RUNS_PER_TASK seeds."""
    check_counts(options, seeds=MOST_SEEDS, trees=MOST_TREE_SETS, goals=MOST_EPISODES, max_steps=MOST_PLAYED)
    given = {"goals": options.goals, "max_steps": options.max_steps}
    seeds = range(FIRST_RUN_SEED, FIRST_RUN_SEED + options.seeds)
    trees = range(FIRST_TREE_SEED, FIRST_TREE_SEED + options.trees)
    found = [
        StudyTask(
            f"retuned-trees{tree}-seeds{options.seeds}",
            {"part": RETUNED, "tree_seed": tree, "run_seeds": list(seeds), **given},
        )
        for tree in trees
    ]
    return found + [
        StudyTask(
            f"trees{tree}-seeds{block[0]}to{block[-1]}",
            {"part": "others", "tree_seed": tree, "run_seeds": list(block), **given},
        )
        for block in batched(seeds, RUNS_PER_TASK)
        for tree in trees
    ]


def run(parameters: Parameters) -> Result:
    """Plays the methods of a task with each of its run seeds; returns their counts and episodes."""
    behaviors = behaviors_of(parameters["tree_seed"])
    loop = WorldLoop(SimulationParameters(max_steps=parameters["max_steps"]))
    result: Result = {"tree_seed": parameters["tree_seed"]}
    methods = {method: fusion for method, fusion in METHODS.items() if method != RETUNED}
    if parameters["part"] == RETUNED:
        wall_m, approach_rad = retuned(behaviors, loop)
        result["retuned"] = [wall_m, approach_rad]
        methods = {
            RETUNED: replace(METHODS[RETUNED], wall_threshold_m=wall_m, approach_threshold_rad=approach_rad),
        }
    stopped = {twins["guided"] for twins in TWINS.values()}
    runs: list[dict[str, object]] = []
    for seed in parameters["run_seeds"]:
        for method, fusion in methods.items():
            fusion = replace(
                fusion, seed=seed, guided=GUIDED_EPISODES, goals=parameters["goals"], episodes=MOST_EPISODES
            )
            policy = after_guidance(replace(fusion, learn=True), behaviors, loop) if method in stopped else None
            runs.append({"method": method, "seed": seed, **play_run(fusion, behaviors, loop, policy)})
    return {**result, "runs": runs}


def play_run(
    fusion: FusionParameters, behaviors: Sequence[Behavior], loop: WorldLoop, policy: Policy | None = None
) -> dict[str, object]:
    """One run of one method: its counts, and [outcome, steps, collisions begun, contact steps] of each episode."""
    session = SoccerSession(fusion, policy, playing_trees(behavior.tree for behavior in behaviors))
    play(session, loop, behaviors, lambda: True)
    counted = [record for record in session.records if record.phase is not Phase.GUIDED]
    result: dict[str, object] = {
        **counts_of(counted),
        "course": [
            [OUTCOMES.index(record.outcome), record.steps, record.collisions_begun, record.collision_steps]
            for record in counted
        ],
        "digest": session.digest,
    }
    learned = session.policy()
    if learned is not None and learned.kind == FbqlLiteral.kind and fusion.learn:
        q = learned.arrays["q"]
        result |= {"joint_states": len(q), "tied": count_ties(q)}
    return result


def table(results: Mapping[str, Result]) -> list[Row]:
    """Methods, with intervals over tree sets and runs and paired with the controls; then the rungs of 50 goals."""
    by_method = runs_of(results)
    rows = with_all_columns(
        {**method_row(method, by_method, CONTROLS | TWINS.get(method, {})), **_tied(runs)}
        for method, runs in by_method.items()
    )
    if PAPER in by_method:
        for method, twins in TWINS.items():
            if method in by_method:
                rows += tables.rung_a_rows(method, by_method, PAPER, *twins.values())
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
    from fbql_studies.common.drawing import keep_and_draw
    from fbql_studies.paper.figures import FIGURES

    by_method = runs_of(results)
    drawn = {method: by_method[method] for method in DRAWN if method in by_method}
    return keep_and_draw(FIGURES, {"paper": courses(drawn)} if by_method else {}, directory)
